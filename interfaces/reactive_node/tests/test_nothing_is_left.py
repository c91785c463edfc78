"""What a node does again and again leaves no memory behind: services run for weeks."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
import reactivex as rx
from rclpy.action import ActionServer
from rclpy.executors import Executor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

from interfaces.reactive_node.tests.fibonacci import Fibonacci
from interfaces.reactive_node.tests.leftovers import assert_nothing_is_left
from reactive_node import ReactiveNode
from reactive_node.actions import GoalUnknown
from reactive_node.executor import create_executor
from reactive_node.testing import SpinFor, SpinUntil

PEERS = 30  # in a round: each takes 0.1 s
PEER_OCTETS = 64.0
"""The heap of the middleware varies by up to 5 kB: 900 peers left 2 octets each, 30 of them up to 30."""
IS_KILTED = hasattr(rclpy_implementation, "TimerCancelledError")

Action = Callable[[], object]
Prepare = Callable[[ReactiveNode, Node, SpinUntil, Executor], Action]


def turn(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    return lambda: executor.spin_until_future_complete(Future(), timeout_sec=0.0)


def task(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    def run() -> None:
        done = executor.create_task(lambda: None)
        spin_until(done.done)

    return run


def message(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    received: list[Any] = []
    node.create_observable(Float64, "topic").subscribe(received.append, scheduler=node.scheduler)
    publisher = peer.create_publisher(Float64, "topic", 10)
    spin_until(lambda: publisher.get_subscription_count() == 1)

    def run() -> None:
        received.clear()
        publisher.publish(Float64(data=1.0))
        spin_until(lambda: received)

    return run


def timer(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    def run() -> None:
        node.destroy_timer(node.create_timer(1.0, lambda: None))
        executor.spin_once(timeout_sec=0.0)

    return run


def delay(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    def run() -> None:
        due: list[Any] = []
        rx.timer(0.0).subscribe(due.append, scheduler=node.scheduler)
        rx.timer(10.0).subscribe(scheduler=node.scheduler).dispose()
        spin_until(lambda: due)

    return run


def call(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    node.serve_recipe(
        lambda requests: requests.map(lambda request: (request, SetBool.Response())), SetBool, "service"
    )
    ask = node.create_call(SetBool, "service", timeout=10.0)

    def run() -> None:
        ended: list[str] = []
        ask(SetBool.Request()).subscribe(on_completed=lambda: ended.append(""), scheduler=node.scheduler)
        spin_until(lambda: ended)

    return run


RESULT_TIMEOUT = 0.3  # s: the server forgets a goal after it; until then, it lists it in each status


def goal(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    def execute(handle: Any) -> Any:
        handle.publish_feedback(Fibonacci.Feedback())
        handle.succeed()
        return Fibonacci.Result()

    ActionServer(peer, Fibonacci, "action", execute, result_timeout=RESULT_TIMEOUT)
    act = node.create_action_call(Fibonacci, "action")

    def forgotten(error: Exception, _: object) -> rx.Observable[Any]:  # on a busy machine
        return rx.empty() if isinstance(error, GoalUnknown) else rx.throw(error)

    def run() -> None:
        ended: list[str] = []
        result = act(Fibonacci.Goal()).catch(forgotten)
        result.subscribe(on_completed=lambda: ended.append(""), scheduler=node.scheduler)
        spin_until(lambda: ended)

    return run


def call_that_waits(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    ask = node.create_call(SetBool, "nobody")

    def run() -> None:
        waiting = ask(SetBool.Request()).subscribe(scheduler=node.scheduler)
        spin_until(lambda: node.scheduler.kept == 0)
        waiting.dispose()
        executor.spin_once(timeout_sec=0.0)

    return run


def parameter(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    node.declare_parameter("value", 0)

    def run() -> None:
        node.create_parameter_observable("value").subscribe(scheduler=node.scheduler).dispose()
        node.set_parameters([Parameter("value", value=1)])
        spin_until(lambda: node.scheduler.kept == 0)

    return run


def graph_and_clock(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    for _ in range(1000):
        node.get_logger().info("what /rosout keeps")

    def run() -> None:
        node.get_topic_names_and_types()
        node.get_publishers_info_by_topic("/rosout")
        node.count_publishers("topic")
        node.get_clock().now().to_msg()
        node.get_logger().info("nothing")

    return run


def observer(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    observable = node.create_observable(Float64, "topic")

    def run() -> None:
        observable.subscribe(scheduler=node.scheduler).dispose()
        executor.spin_once(timeout_sec=0.0)

    return run


def publication(node: ReactiveNode, peer: Node, spin_until: SpinUntil, executor: Executor) -> Action:
    def run() -> None:
        node.publish_observable(rx.never(), Float64, "topic").dispose()
        executor.spin_once(timeout_sec=0.0)

    return run


@pytest.mark.parametrize(
    "prepare",
    [
        *(turn, task, message, timer, delay, call, call_that_waits),
        *(goal, parameter, graph_and_clock, observer, publication),
    ],
    ids=lambda prepare: prepare.__name__,
)
def test_nothing_is_left_of(
    node: ReactiveNode,
    peer: Node,
    spin_until: SpinUntil,
    spin_for: SpinFor,
    executor: Executor,
    prepare: Prepare,
) -> None:
    if prepare in (call, goal) and IS_KILTED:
        pytest.skip(
            "platform: on ROS 2 Kilted a served call leaves one block, a goal six; the cause is not known"
        )
    seconds = 4.0 * RESULT_TIMEOUT if prepare is goal else 0.1
    assert_nothing_is_left(prepare(node, peer, spin_until, executor), lambda: spin_for(seconds))


PEER = """
import faulthandler, sys
faulthandler.dump_traceback_later(120, exit=True)  # the test would wait for a process that hangs
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from std_msgs.msg import Float64

for _ in sys.stdin:
    context = Context()
    rclpy.init(args=[], context=context, domain_id=int(sys.argv[1]))
    node = Node("stranger", context=context, enable_rosout=False, start_parameter_services=False)
    node.create_publisher(Float64, "topic", 10)
    sys.stdin.readline()
    node.destroy_node()
    context.shutdown()
"""


@pytest.mark.parametrize("executor", [create_executor], indirect=True, ids=["services"])
def test_nothing_is_left_of_a_peer_that_comes_and_goes(
    node: ReactiveNode, domain_id: int, spin_for: SpinFor, executor: Executor
) -> None:
    node.create_observable(Float64, "topic").subscribe(scheduler=node.scheduler)
    with subprocess.Popen([sys.executable, "-c", PEER, str(domain_id)], stdin=subprocess.PIPE) as peer:
        assert peer.stdin is not None

        def come_and_go() -> None:
            for publishers in (1, 0):
                peer.stdin.write(b"\n")
                peer.stdin.flush()
                while node.count_publishers("topic") != publishers:
                    executor.spin_once(timeout_sec=0.002)

        assert_nothing_is_left(come_and_go, lambda: spin_for(0.1), PEERS, PEER_OCTETS)
        peer.stdin.close()
