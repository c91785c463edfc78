"""Services and clients: calls, timeouts, lost servers, several clients."""

from __future__ import annotations

import threading

import pytest
from deploy.ground.tests.nodes import Call, MakeNode, SpinUntil, spinning
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger


def answer(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
    response.success = True
    response.message = "ok"
    return response


def negate(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
    response.success = not request.data
    return response


def test_a_call_gets_its_reply(node: Node, call: Call) -> None:
    node.create_service(Trigger, "turn_on", answer)
    assert call(Trigger, "turn_on") == Trigger.Response(success=True, message="ok")


def test_several_clients_get_their_replies(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    server = make_node("server")
    executor.add_node(server)
    server.create_service(SetBool, "negate", negate)
    clients = []
    for number in range(3):
        node = make_node(f"client{number}")
        executor.add_node(node)
        clients.append(node.create_client(SetBool, "negate"))
    assert all(client.wait_for_service(timeout_sec=10) for client in clients)
    calls = [
        (value, clients[index].call_async(SetBool.Request(data=value)))
        for number in range(3)  # nine calls, because the queues of a service hold ten
        for index in range(3)
        for value in [(number + index) % 2 == 0]  # the calls of a number differ
    ]
    spin_until(lambda: all(future.done() for _, future in calls))
    assert [future.result().success for _, future in calls] == [not value for value, _ in calls]


def test_a_coroutine_may_answer_a_request_later(node: Node, call: Call) -> None:
    ready: Future = Future()

    async def answer_later(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.message = await ready
        return response

    node.create_service(Trigger, "later", answer_later, callback_group=MutuallyExclusiveCallbackGroup())
    node.create_timer(0.05, lambda: ready.done() or ready.set_result("at last"))
    assert call(Trigger, "later").message == "at last"


def test_a_blocking_call_works_while_another_thread_spins(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    node.create_service(Trigger, "turn_on", answer)
    client = node.create_client(Trigger, "turn_on", callback_group=MutuallyExclusiveCallbackGroup())
    with spinning(MultiThreadedExecutor(2, context=context), node):
        assert client.wait_for_service(timeout_sec=10)
        response = client.call(Trigger.Request(), timeout_sec=10)
    assert response.message == "ok"


@pytest.mark.parametrize("timeout", [0.05, 0.0, -1.0])
def test_waiting_for_a_missing_service_ends_with_the_timeout(make_node: MakeNode, timeout: float) -> None:
    client = make_node().create_client(Trigger, "missing")
    assert not client.service_is_ready()
    assert not client.wait_for_service(timeout_sec=timeout)


def test_shutdown_ends_a_loop_that_waits_for_a_service(make_node: MakeNode, context: Context) -> None:
    client = make_node().create_client(Trigger, "missing")
    threading.Timer(0.2, context.shutdown).start()

    def wait() -> None:
        while not client.wait_for_service(timeout_sec=0.1):
            pass

    with pytest.raises(rclpy_implementation.RCLError, match=r"shut down|context is invalid"):
        wait()


def test_a_second_server_answers_after_the_first_is_destroyed(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    client_node, first = make_node("client"), make_node("first")
    executor.add_node(client_node)
    executor.add_node(first)
    first.create_service(Trigger, "turn_on", answer)
    client = client_node.create_client(Trigger, "turn_on")
    assert client.wait_for_service(timeout_sec=10)
    first.destroy_node()
    spin_until(lambda: not client.service_is_ready())
    lost = client.call_async(Trigger.Request())
    second = make_node("second")
    executor.add_node(second)
    second.create_service(Trigger, "turn_on", answer)
    assert client.wait_for_service(timeout_sec=10)
    future = client.call_async(Trigger.Request())
    spin_until(future.done)
    assert future.result().message == "ok"
    assert not lost.done()
