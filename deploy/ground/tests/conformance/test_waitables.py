"""Waitables of users: what wakes them, when they run, how they are removed."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import pytest
from deploy.ground.tests.nodes import SpinUntil
from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.event_handler import EventHandler, QoSSubscriptionEventType, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.timer import Timer
from rclpy.waitable import NumberOfEntities, Waitable
from std_msgs.msg import Float64


class Bell(Waitable):
    """Runs whenever its guard condition was triggered."""

    def __init__(self, context: Context, group: CallbackGroup) -> None:
        super().__init__(group)
        self.guard = GuardCondition(callback=None, callback_group=None, context=context)
        self.index = 0
        self.executed: list[Any] = []
        self.threads: set[int] = set()

    def get_num_entities(self) -> NumberOfEntities:
        return NumberOfEntities(num_gcs=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        self.index = wait_set.add_guard_condition(self.guard.handle)

    def is_ready(self, wait_set: Any) -> bool:
        return bool(wait_set.is_ready("guard_condition", self.index))

    def take_data(self) -> Any:
        return "ding"

    async def execute(self, taken_data: Any) -> None:
        self.threads.add(threading.get_ident())
        self.executed.append(taken_data)


class Ticker(Waitable):
    """Runs whenever its timer is due."""

    def __init__(self, context: Context) -> None:
        super().__init__(ReentrantCallbackGroup())
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        self.timer = Timer(lambda: None, None, 10_000_000, clock, context=context)  # type: ignore[arg-type]
        self.index = 0
        self.ticks = 0

    def get_num_entities(self) -> NumberOfEntities:
        return NumberOfEntities(num_timers=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        self.index = wait_set.add_timer(self.timer.handle)

    def is_ready(self, wait_set: Any) -> bool:
        return bool(wait_set.is_ready("timer", self.index))

    def take_data(self) -> Any:
        self.timer.handle.call_timer()
        return None

    async def execute(self, taken_data: Any) -> None:
        assert taken_data is None
        self.ticks += 1


@pytest.fixture
def bell(node: Node, context: Context) -> Iterator[Bell]:
    bell = Bell(context, node.default_callback_group)
    node.add_waitable(bell)
    yield bell
    if bell in list(node.waitables):
        node.remove_waitable(bell)


def test_a_guard_condition_runs_a_waitable(
    bell: Bell, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    bell.guard.trigger()
    spin_until(lambda: bell.executed == ["ding"])
    for _ in range(3):
        executor.spin_once(timeout_sec=0.01)
    assert bell.executed == ["ding"]
    bell.guard.trigger()
    spin_until(lambda: len(bell.executed) == 2)


def test_a_waitable_may_have_a_guard_condition_of_the_extension(
    bell: Bell, context: Context, spin_until: SpinUntil
) -> None:
    class Alarm:
        def __init__(self) -> None:
            with context.handle:
                self.handle = rclpy_implementation.GuardCondition(context.handle)

    alarm: Any = Alarm()
    bell.guard = alarm
    alarm.handle.trigger_guard_condition()
    spin_until(lambda: bell.executed == ["ding"])


def test_a_timer_runs_a_waitable(node: Node, context: Context, spin_until: SpinUntil) -> None:
    ticker = Ticker(context)
    node.add_waitable(ticker)
    spin_until(lambda: ticker.ticks >= 3)
    ticker.timer.cancel()
    node.remove_waitable(ticker)


def test_an_overdue_timer_runs_a_waitable(node: Node, context: Context, spin_until: SpinUntil) -> None:
    ticker = Ticker(context)
    node.add_waitable(ticker)
    while not ticker.timer.is_ready():
        time.sleep(0.001)
    spin_until(lambda: ticker.ticks >= 1)
    ticker.timer.cancel()
    node.remove_waitable(ticker)


def test_several_waitables_and_other_entities_share_an_executor(
    bell: Bell, node: Node, context: Context, spin_until: SpinUntil
) -> None:
    other, ticker = Bell(context, ReentrantCallbackGroup()), Ticker(context)
    heard: list[float] = []
    node.add_waitable(other)
    node.add_waitable(ticker)
    node.create_subscription(Float64, "x", lambda message: heard.append(message.data), 10)
    publisher = node.create_publisher(Float64, "x", 10)
    spin_until(lambda: publisher.get_subscription_count())
    publisher.publish(Float64(data=1.0))
    other.guard.trigger()
    spin_until(lambda: heard and other.executed and ticker.ticks)
    assert bell.executed == []
    node.remove_waitable(other)
    node.remove_waitable(ticker)


def test_an_event_handler_may_be_added_as_a_waitable(node: Node, spin_until: SpinUntil) -> None:
    silent = SubscriptionEventCallbacks(use_default_callbacks=False)
    subscription = node.create_subscription(Float64, "x", lambda _: None, 1, event_callbacks=silent)
    matches: list[Any] = []
    handler = EventHandler(
        callback_group=node.default_callback_group,
        callback=matches.append,
        event_type=QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED,
        parent_impl=subscription.handle,
    )
    node.add_waitable(handler)
    node.create_publisher(Float64, "x", 1)
    spin_until(lambda: matches)
    assert matches[0].current_count == 1
    node.remove_waitable(handler)
