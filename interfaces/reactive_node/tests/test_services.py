from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
import reactivex as rx
from rclpy.client import Client
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.service import Service
from rclpy.task import Future
from reactivex import Observable
from reactivex.scheduler import NewThreadScheduler
from reactivex.subject import Subject
from std_srvs.srv import SetBool

from reactive_node import ReactiveNode
from reactive_node.testing import SpinFor, SpinUntil

Answer = tuple[SetBool.Request, SetBool.Response]


def answered(request: SetBool.Request, message: str = "") -> Answer:
    return request, SetBool.Response(success=request.data, message=message)


class Caller:
    def __init__(self, peer: Node, spin_until: SpinUntil) -> None:
        self.client: Client = peer.create_client(SetBool, "switch")
        self.spin_until = spin_until

    def call(self, data: bool) -> Future:
        self.spin_until(self.client.service_is_ready)
        return self.client.call_async(SetBool.Request(data=data))

    def response(self, data: bool) -> Any:
        future = self.call(data)
        self.spin_until(future.done)
        return future.result()


@pytest.fixture
def caller(peer: Node, spin_until: SpinUntil) -> Caller:
    return Caller(peer, spin_until)


def test_recipe_answers_requests(node: ReactiveNode, caller: Caller) -> None:
    node.serve_recipe(lambda requests: requests.map(answered), SetBool, "switch")

    assert caller.response(True).success is True
    assert caller.response(False).success is False


def test_recipe_runs_by_clock_of_node(node: ReactiveNode, caller: Caller) -> None:
    threads: list[int] = []

    def later(requests: Observable[SetBool.Request]) -> Observable[Answer]:
        return requests.delay(0.05).do_action(lambda _: threads.append(threading.get_ident())).map(answered)

    node.serve_recipe(later, SetBool, "switch")

    assert caller.response(True).success is True
    assert threads == [threading.get_ident()]


def test_equal_requests_of_two_clients_are_distinguished(
    node: ReactiveNode, peer: Node, caller: Caller, spin_until: SpinUntil
) -> None:
    requests_seen: list[SetBool.Request] = []
    answers: Subject[Answer] = Subject()

    def recipe(requests: Observable[SetBool.Request]) -> Observable[Answer]:
        return rx.merge(requests.do_action(requests_seen.append).ignore_elements(), answers)

    node.serve_recipe(recipe, SetBool, "switch")
    first = caller.call(True)
    spin_until(lambda: len(requests_seen) == 1)
    second = Caller(peer, spin_until).call(True)
    spin_until(lambda: len(requests_seen) == 2)

    answers.on_next(answered(requests_seen[1], "second"))
    spin_until(second.done)
    answers.on_next(answered(requests_seen[0], "first"))
    spin_until(first.done)

    assert (first.result().message, second.result().message) == ("first", "second")


def test_answer_of_another_thread_wakes_sleeping_executor(
    node: ReactiveNode, caller: Caller, executor: SingleThreadedExecutor
) -> None:
    def answer(request: SetBool.Request) -> Answer:
        time.sleep(0.2)  # meanwhile the executor falls asleep
        return answered(request)

    node.serve_recipe(
        lambda requests: requests.observe_on(NewThreadScheduler()).map(answer), SetBool, "switch"
    )

    response = caller.call(True)
    executor.spin_until_future_complete(response, timeout_sec=10.0)
    assert response.done()


def test_recipe_does_not_run_in_parallel_with_callbacks_of_node(context: Context, domain_id: int) -> None:
    node = ReactiveNode("reactive", context=context)
    peer = Node("peer", context=context)
    ran = threading.Event()
    overlapped: list[bool] = []

    def serve(requests: Observable[SetBool.Request]) -> Observable[Answer]:
        return requests.do_action(lambda _: ran.set()).map(answered)

    node.serve_recipe(serve, SetBool, "switch")
    client = peer.create_client(SetBool, "switch")
    with MultiThreadedExecutor(4, context=context) as executor:
        executor.add_node(node)
        executor.add_node(peer)
        assert client.wait_for_service(10.0)

        def call() -> None:
            once.cancel()
            client.call_async(SetBool.Request())
            overlapped.append(ran.wait(0.3))

        once = node.create_timer(0.0, call)
        deadline = time.monotonic() + 10.0
        while not (ran.is_set() and overlapped) and time.monotonic() < deadline:
            executor.spin_once(timeout_sec=0.1)
    node.destroy_node()
    peer.destroy_node()

    assert (ran.is_set(), overlapped) == (True, [False])


# Errors


def late(requests: Observable[SetBool.Request]) -> Observable[Answer]:
    return requests.map(lambda request: answered(SetBool.Request(data=request.data)))


@pytest.mark.parametrize(
    ("recipe", "error", "text"),
    [
        (lambda requests: requests.map(lambda _: 1 / 0), ZeroDivisionError, "division by zero"),
        (
            lambda requests: requests.take(1).filter(lambda _: False),
            RuntimeError,
            "the recipe of switch completed",
        ),
        (
            lambda requests: requests.map(lambda _: SetBool.Response()),
            TypeError,
            r"the recipe of switch must emit pairs of a request and its SetBool.Response, not .*Response\(",
        ),
        (lambda requests: requests.map(lambda request: (request, True)), TypeError, "must emit pairs"),
        (late, ValueError, "the recipe of switch answered a request that does not wait"),
        (
            lambda requests: requests.flat_map(lambda request: rx.of(answered(request), answered(request))),
            ValueError,
            "answered a request that does not wait",
        ),
    ],
    ids=["error", "completion", "no pair", "wrong type", "copy of request", "two answers"],
)
def test_fault_of_recipe_is_raised_by_spin_and_ends_service(
    node: ReactiveNode,
    caller: Caller,
    spin_until: SpinUntil,
    recipe: Callable[[Observable[Any]], Observable[Any]],
    error: type[Exception],
    text: str,
) -> None:
    node.serve_recipe(recipe, SetBool, "switch")
    caller.call(True)

    with pytest.raises(error, match=text):
        spin_until(lambda: False)
    spin_until(lambda: not caller.client.service_is_ready())


def test_fault_at_start_is_raised_by_spin(node: ReactiveNode, spin_until: SpinUntil) -> None:
    node.serve_recipe(lambda _: rx.throw(ValueError("planted")), SetBool, "switch")

    with pytest.raises(ValueError, match="planted"):
        spin_until(lambda: False)
    assert not [service for service in node.services if service.srv_name.endswith("switch")]


# The end of the service


@pytest.mark.parametrize("end", ["service", "node"])
def test_end_of_service_or_node_ends_recipe(
    node: ReactiveNode, caller: Caller, spin_until: SpinUntil, end: str
) -> None:
    ended: list[bool] = []
    service = node.serve_recipe(
        lambda requests: requests.finally_action(lambda: ended.append(True)).map(answered), SetBool, "switch"
    )
    assert caller.response(True).success is True

    for _ in range(2):
        service.dispose() if end == "service" else node.destroy_node()

    assert ended == [True]
    spin_until(lambda: not caller.client.service_is_ready())


def test_disposed_service_does_not_send_its_last_answer(
    node: ReactiveNode,
    caller: Caller,
    spin_until: SpinUntil,
    spin_for: SpinFor,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sent: list[Any] = []  # ROS 2's rclpy raises an error for a service that was destroyed
    monkeypatch.setattr(Service, "send_response", lambda *arguments: sent.append(arguments))
    answers: Subject[Answer] = Subject()
    requests_seen: list[SetBool.Request] = []

    def recipe(requests: Observable[SetBool.Request]) -> Observable[Answer]:
        return rx.merge(requests.do_action(requests_seen.append).ignore_elements(), answers)

    service = node.serve_recipe(recipe, SetBool, "switch")
    caller.call(True)
    spin_until(lambda: requests_seen)

    answers.on_next(answered(requests_seen[0]))
    service.dispose()
    spin_for(0.05)

    assert sent == []
