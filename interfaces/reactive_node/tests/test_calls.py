from __future__ import annotations

import threading
from typing import Any

from rclpy.node import Node
from rclpy.parameter import Parameter
from reactivex.subject import Subject
from std_srvs.srv import SetBool

from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinFor, SpinUntil


def answer(request: Any, response: Any) -> Any:
    response.success = request.data
    response.message = "answered"
    return response


def test_call_emits_response(node: ReactiveNode, peer: Node, spin_until: SpinUntil) -> None:
    peer.create_service(SetBool, "switch", answer)
    call = node.create_call(SetBool, "switch", timeout=10.0)
    requests: Subject[SetBool.Request] = Subject()
    responses: list[tuple[bool, str]] = []
    requests.flat_map(call).subscribe(lambda response: responses.append((response.success, response.message)))

    requests.on_next(SetBool.Request(data=True))
    spin_until(lambda: responses == [(True, "answered")])
    requests.on_next(SetBool.Request(data=False))
    spin_until(lambda: responses == [(True, "answered"), (False, "answered")])


def test_slow_server_gets_one_request(node: ReactiveNode, make_node: MakeNode, spin_until: SpinUntil) -> None:
    served: list[Any] = []
    responses: list[Any] = []
    make_node("server").serve_recipe(
        lambda requests: (
            requests.do_action(served.append).delay(0.2).map(lambda request: (request, SetBool.Response()))
        ),
        SetBool,
        "switch",
    )

    node.create_call(SetBool, "switch")(SetBool.Request()).subscribe(responses.append)
    spin_until(lambda: responses)

    assert len(served) == 1


def test_call_finds_server_while_simulated_time_stands_still(
    make_node: MakeNode, peer: Node, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    node = make_node("simulated", parameter_overrides=[Parameter("use_sim_time", value=True)])
    responses: list[Any] = []
    node.create_call(SetBool, "unpause", timeout=1.0)(SetBool.Request()).subscribe(responses.append)
    spin_for(0.1)

    peer.create_service(SetBool, "unpause", answer)
    spin_until(lambda: responses)


def test_call_without_response_ends_in_timeout_error(node: ReactiveNode, spin_until: SpinUntil) -> None:
    errors: list[tuple[Exception, int]] = []
    call = node.create_call(SetBool, "nowhere", timeout=0.1)

    call(SetBool.Request()).subscribe(on_error=lambda error: errors.append((error, threading.get_ident())))
    spin_until(lambda: errors)

    ((error, thread),) = errors
    assert isinstance(error, TimeoutError)
    assert str(error) == "no response of nowhere within 0.1 s"
    assert thread == threading.get_ident()


def test_abandoned_call_emits_nothing(
    node: ReactiveNode, peer: Node, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    served: list[bool] = []

    def serve(request: Any, response: Any) -> Any:
        served.append(True)
        call.dispose()
        return response

    peer.create_service(SetBool, "switch", serve)
    responses: list[Any] = []
    call = node.create_call(SetBool, "switch")(SetBool.Request()).subscribe(responses.append)
    spin_until(lambda: served)
    spin_for(0.05)

    assert responses == []


def test_calls_that_wait_share_one_timer(node: ReactiveNode, peer: Node, spin_until: SpinUntil) -> None:
    timers = len([*node.timers])
    responses: list[Any] = []
    call = node.create_call(SetBool, "switch")
    for _ in range(1000):
        call(SetBool.Request()).subscribe(responses.append, scheduler=node.scheduler)
    spin_until(lambda: len([*node.timers]) > timers)
    assert len([*node.timers]) == timers + 1

    peer.create_service(SetBool, "switch", answer)
    spin_until(lambda: responses and len([*node.timers]) == timers)


def test_each_call_waits_for_its_own_server(node: ReactiveNode, peer: Node, spin_until: SpinUntil) -> None:
    responses: list[str] = []
    for name in ("one", "two"):
        call = node.create_call(SetBool, name)
        call(SetBool.Request()).subscribe(lambda _, name=name: responses.append(name))
    peer.create_service(SetBool, "two", answer)
    spin_until(lambda: responses == ["two"])
    peer.create_service(SetBool, "one", answer)
    spin_until(lambda: responses == ["two", "one"])


def test_calls_that_are_abandoned_on_other_threads_end_the_timer(
    node: ReactiveNode, spin_until: SpinUntil
) -> None:
    timers = len([*node.timers])
    call = node.create_call(SetBool, "switch")
    for _ in range(20):
        calls = [call(SetBool.Request()).subscribe(scheduler=node.scheduler) for _ in range(10)]
        threads = [threading.Thread(target=each.dispose) for each in calls]
        for thread in threads:
            thread.start()
        spin_until(lambda: not any(thread.is_alive() for thread in threads))  # noqa: B023
    spin_until(lambda: len([*node.timers]) == timers)
