from __future__ import annotations

import threading

import pytest
from deploy.ground.tests.nodes import MakeNode
from rclpy.clock import Clock, ClockType, JumpThreshold, ROSClock, TimeJump
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from rclpy.time import Time
from rclpy.time_source import TimeSource


def ros_time(nanoseconds: int) -> Time:
    return Time(nanoseconds=nanoseconds, clock_type=ClockType.ROS_TIME)


def test_a_timer_in_simulated_time_is_due_exactly_after_its_period(
    make_node: MakeNode, clock: ROSClock
) -> None:
    timer = make_node().create_timer(1e-6, lambda: None, clock=clock)
    assert timer.time_until_next_call() == 1000
    clock.set_ros_time_override(ros_time(1999))
    assert not timer.is_ready()
    clock.set_ros_time_override(ros_time(2000))
    assert timer.is_ready()


# The second case skips a whole number of periods.
@pytest.mark.parametrize(("now", "left"), [(4300, 700), (3000, 1000)])
def test_a_timer_skips_missed_periods_and_does_not_drift(
    clock: ROSClock, executor: SingleThreadedExecutor, now: int, left: int, node: Node
) -> None:
    calls: list[int] = []
    timer = node.create_timer(1e-6, lambda: calls.append(clock.now().nanoseconds), clock=clock)
    clock.set_ros_time_override(ros_time(now))
    executor.spin_once(timeout_sec=0)
    executor.spin_once(timeout_sec=0)
    assert calls == [now]
    assert timer.time_until_next_call() == left


def test_a_jump_back_starts_a_new_period(make_node: MakeNode, clock: ROSClock) -> None:
    timer = make_node().create_timer(1e-6, lambda: None, clock=clock)
    clock.set_ros_time_override(ros_time(500))
    assert timer.time_until_next_call() == 1000


def test_the_first_simulated_time_begins_the_period(make_node: MakeNode) -> None:
    clock = ROSClock()
    timer = make_node().create_timer(1e-6, lambda: None, clock=clock)
    simulator = TimeSource()
    simulator.ros_time_is_active = True
    simulator.attach_clock(clock)
    assert not timer.is_ready()
    clock.set_ros_time_override(ros_time(5_000_000))
    assert not timer.is_ready()
    assert timer.time_until_next_call() == 1000


def test_a_canceled_timer_is_never_ready_until_its_reset(make_node: MakeNode, clock: ROSClock) -> None:
    timer = make_node().create_timer(1e-6, lambda: None, clock=clock)
    timer.cancel()
    clock.set_ros_time_override(ros_time(9000))
    assert timer.is_canceled()
    assert not timer.is_ready()
    assert timer.time_until_next_call() is None
    timer.reset()
    assert timer.time_until_next_call() == 1000


def test_a_timer_without_autostart_waits_for_its_reset(make_node: MakeNode, clock: ROSClock) -> None:
    timer = make_node().create_timer(1e-6, lambda: None, clock=clock, autostart=False)
    assert timer.is_canceled()


def test_a_changed_period_takes_effect_at_the_next_call(
    clock: ROSClock, executor: SingleThreadedExecutor, node: Node
) -> None:
    timer = node.create_timer(1e-6, lambda: None, clock=clock)
    timer.timer_period_ns = 5000
    assert timer.time_until_next_call() == 1000
    clock.set_ros_time_override(ros_time(2000))
    executor.spin_once(timeout_sec=0)
    assert timer.time_until_next_call() == 5000


def test_a_destroyed_timer_cannot_be_used(make_node: MakeNode) -> None:
    node = make_node()
    timer = node.create_timer(1.0, lambda: None)
    assert node.destroy_timer(timer)
    assert not node.destroy_timer(timer)
    with pytest.raises(InvalidHandle):
        timer.is_ready()


def test_shortening_the_period_on_another_thread_wakes_the_executor(
    executor: SingleThreadedExecutor, node: Node
) -> None:
    called = threading.Event()
    timer = node.create_timer(3600.0, called.set)
    spinning = threading.Thread(target=executor.spin_once)
    spinning.start()
    timer.timer_period_ns = 0
    timer.reset()
    spinning.join(10)
    assert called.is_set()


def test_jump_callbacks_are_called_at_or_beyond_their_threshold(clock: ROSClock) -> None:
    jumps: list[int] = []

    def note(jump: TimeJump) -> None:
        jumps.append(jump.delta.nanoseconds)

    threshold = JumpThreshold(min_forward=Duration(nanoseconds=100), min_backward=Duration(nanoseconds=-50))
    with clock.create_jump_callback(threshold, post_callback=note):
        for nanoseconds in (1099, 1199, 1150, 1149, 1099):
            clock.set_ros_time_override(ros_time(nanoseconds))
    clock.set_ros_time_override(ros_time(5000))
    assert jumps == [100, -50]


def test_sleep_until_ends_at_its_simulated_time(context: Context, clock: ROSClock) -> None:
    ended: list[bool] = []
    sleeper = threading.Thread(target=lambda: ended.append(clock.sleep_until(ros_time(2000), context)))
    sleeper.start()
    for nanoseconds in (1500, 1999, 2000):
        clock.set_ros_time_override(ros_time(nanoseconds))
    sleeper.join(10)
    assert ended == [True]


def test_sleep_until_ends_with_its_context(context: Context, monkeypatch: pytest.MonkeyPatch) -> None:
    ended: list[bool] = []
    begun = threading.Event()
    context_ok = context.ok

    def ok() -> bool:
        was_ok = context_ok()
        begun.set()
        return was_ok

    monkeypatch.setattr(context, "ok", ok)
    clock = Clock(clock_type=ClockType.STEADY_TIME)
    sleeper = threading.Thread(target=lambda: ended.append(clock.sleep_for(Duration(seconds=3600), context)))
    sleeper.start()
    assert begun.wait(10)
    context.shutdown()
    sleeper.join(10)
    assert ended == [False]


def test_a_rate_wakes_its_sleeper_every_period(executor: SingleThreadedExecutor, node: Node) -> None:
    rate = node.create_rate(100.0)
    slept: list[bool] = []
    end = Future()

    def sleep() -> None:
        for _ in range(3):
            rate.sleep()
            slept.append(True)
        end.set_result(None)

    sleeper = threading.Thread(target=sleep)
    sleeper.start()
    executor.spin_until_future_complete(end)
    sleeper.join(10)
    assert slept == [True] * 3
