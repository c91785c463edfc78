"""Waitables: wrong use of a wait set, lost triggers, and actions as waitables."""

from __future__ import annotations

from typing import Any

import pytest
from deploy.runtime.tests.nodes import SpinUntil

from example_interfaces.action import Fibonacci
from rclpy._wait_set import WaitSet
from rclpy.action import ActionClient, ActionServer
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.guard_condition import GuardCondition
from rclpy.node import Node
from rclpy.subscription import Subscription
from rclpy.waitable import Waitable
from std_msgs.msg import Float64


class Recorder(Waitable):
    def __init__(self, kind: str, *handles: Any) -> None:
        super().__init__(ReentrantCallbackGroup())
        self.kind, self.handles = kind, handles
        self.indices: list[int] = []
        self.runs = 0

    def add_to_wait_set(self, wait_set: Any) -> None:
        add = getattr(wait_set, f"add_{self.kind}")
        self.indices = [add(handle) for handle in self.handles]

    def is_ready(self, wait_set: Any) -> bool:
        return any(wait_set.is_ready(self.kind, index) for index in self.indices)

    def take_data(self) -> None:
        return None

    async def execute(self, taken_data: Any) -> None:
        self.runs += 1


def test_wrong_questions_to_a_wait_set_are_errors() -> None:
    wait_set = WaitSet()
    with pytest.raises(RuntimeError, match="'publisher' is not a known entity"):
        wait_set.is_ready("publisher", 0)
    for index in (-1, 0):
        with pytest.raises(IndexError):
            wait_set.is_ready("timer", index)
    with pytest.raises(AttributeError):
        wait_set.add_client  # noqa: B018  # the handle of a client is a writer


def test_a_guard_condition_runs_its_callback_and_waitables(node: Node, spin_until: SpinUntil) -> None:
    calls: list[None] = []
    guard = node.create_guard_condition(lambda: calls.append(None))
    waitables = [Recorder("guard_condition", guard.handle) for _ in range(2)]
    for waitable in waitables:
        node.add_waitable(waitable)
    guard.trigger()
    spin_until(lambda: calls and all(waitable.runs for waitable in waitables))
    assert (len(calls), [waitable.runs for waitable in waitables]) == (1, [1, 1])


def test_a_trigger_while_the_callback_group_is_busy_is_kept(
    node: Node, context: Context, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    guard = GuardCondition(None, None, context=context)
    waitable = Recorder("guard_condition", guard.handle)
    group = waitable.callback_group = MutuallyExclusiveCallbackGroup()
    node.add_waitable(waitable)
    executor.spin_once(0.0)
    guard.trigger()
    watch = executor._rclpy_watch
    assert watch is not None
    assert watch.prepare() == 0
    (entity,) = watch.ready([])
    other = object()
    assert group.beginning_execution(other)
    executor._rclpy_block(entity)
    executor.spin_once(0.0)
    assert waitable.runs == 0
    group.ending_execution(other)
    spin_until(lambda: waitable.runs == 1)


def test_messages_wake_a_waitable_that_polls_a_subscription(node: Node, spin_until: SpinUntil) -> None:
    silent = node.create_publisher(Float64, "x", 10)
    subscription = node._rclpy_make_subscription(
        Float64, "x", lambda _: None, 10, node.default_callback_group, _no_events()
    )

    class Poller(Recorder):
        taken: list[float] = []

        def take_data(self) -> None:
            while (found := subscription.handle.take_message(Float64, False)) is not None:
                self.taken.append(found[0].data)

    waitable = Poller("subscription", subscription.handle)
    node.add_waitable(waitable)
    spin_until(lambda: silent.get_subscription_count())
    silent.publish(Float64(data=2.0))
    spin_until(lambda: waitable.runs)
    assert waitable.taken == [2.0]
    node.remove_waitable(waitable)
    assert isinstance(subscription, Subscription)
    subscription.destroy()


def _no_events() -> Any:
    from rclpy.event_handler import SubscriptionEventCallbacks

    return SubscriptionEventCallbacks(use_default_callbacks=False)


def test_a_waitable_may_consist_of_an_action_client(
    node: Node, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    def execute(goal_handle: Any) -> Any:
        goal_handle.succeed()
        return Fibonacci.Result()

    server = ActionServer(node, Fibonacci, "fibonacci", execute)
    client = ActionClient(node, Fibonacci, "fibonacci")
    for one in (server, client):  # from now on, they are run as any waitable
        node.remove_waitable(one)
        node.add_waitable(one)
    assert client.wait_for_server(timeout_sec=10)
    future = client.send_goal_async(Fibonacci.Goal())
    spin_until(future.done)
    assert future.result().accepted
    for one in (server, client):
        node.remove_waitable(one)
        one.destroy()
