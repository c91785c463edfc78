"""Simulated time and ``wait_for_message``: rejected changes, detached nodes, contexts that end."""

from __future__ import annotations

import threading
import time
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode

from builtin_interfaces.msg import Time as TimeMsg
from rcl_interfaces.msg import SetParametersResult
from rclpy import time_source
from rclpy.clock import JumpThreshold, ROSClock
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from rclpy.wait_for_message import wait_for_message
from rosgraph_msgs.msg import Clock as ClockMsg
from std_msgs.msg import String


def set_use_sim_time(node: Node, value: bool) -> SetParametersResult:
    return node.set_parameters([Parameter("use_sim_time", value=value)])[0]


def test_a_rejected_change_keeps_system_time(make_node: MakeNode) -> None:
    node = make_node()

    def reject(parameters: list[Parameter]) -> SetParametersResult:
        return SetParametersResult(successful=False, reason="not now")

    # Appended: the time source is asked before this callback.
    node._on_set_parameters_callbacks.append(reject)
    assert set_use_sim_time(node, True).reason == "not now"
    assert not node.get_clock().ros_time_is_active  # type: ignore[attr-defined]


def test_a_detached_time_source_no_longer_follows_its_node(make_node: MakeNode) -> None:
    node = make_node()
    source = node._time_source
    set_use_sim_time(node, True)
    source.detach_node()
    assert list(node.subscriptions) == []
    set_use_sim_time(node, False)
    assert source.ros_time_is_active


def test_wait_for_message_ends_with_its_context(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    result: list[tuple[bool, Any]] = []
    thread = threading.Thread(target=lambda: result.append(wait_for_message(String, node, "silence")))
    thread.start()
    while thread.is_alive() and not list(node.subscriptions):
        thread.join(0.001)
    context.shutdown()
    thread.join(10)
    assert result == [(False, None)]


def test_wait_for_message_ends_if_the_context_ends_before_the_wait(
    make_node: MakeNode, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    create_subscription = node.create_subscription

    def create_and_shut_down(*args: Any, **options: Any) -> Any:
        subscription = create_subscription(*args, **options)
        context.shutdown()
        return subscription

    monkeypatch.setattr(node, "create_subscription", create_and_shut_down)
    assert wait_for_message(String, node, "silence") == (False, None)


# A silent clock topic

WARNING = (
    "use_sim_time is true, but /clock was silent for 0.01 s: start a simulator, or set use_sim_time to false"
)
SIMULATED = [Parameter("use_sim_time", value=True)]


@pytest.fixture
def timeout(monkeypatch: pytest.MonkeyPatch) -> float:
    """The time without a message until the warning [s], shortened."""
    monkeypatch.setattr(time_source, "CLOCK_TIMEOUT", 0.01)
    return 0.01


def test_timeout_is_two_seconds_of_steady_time(make_node: MakeNode) -> None:
    (timer,) = make_node(parameter_overrides=SIMULATED).timers
    assert timer.timer_period_ns == 2_000_000_000
    assert timer.clock.clock_type == ClockType.STEADY_TIME


def test_silent_clock_topic_is_warned_of_once(
    timeout: float,
    make_node: MakeNode,
    executor: SingleThreadedExecutor,
    capfd: pytest.CaptureFixture[str],
) -> None:
    node = make_node(parameter_overrides=SIMULATED)
    executor.add_node(node)
    executor.spin_once(timeout_sec=10)
    assert WARNING in capfd.readouterr().err
    assert list(node.timers) == []


def test_waiting_time_is_no_silence(
    timeout: float,
    make_node: MakeNode,
    executor: SingleThreadedExecutor,
    capfd: pytest.CaptureFixture[str],
) -> None:
    publisher = make_node("simulator").create_publisher(ClockMsg, "/clock", 1)
    node = make_node(parameter_overrides=SIMULATED)
    publisher.publish(ClockMsg(clock=TimeMsg(sec=5)))
    time.sleep(10 * timeout)  # the node does not spin
    executor.add_node(node)
    executor.spin_once(timeout_sec=10)
    assert node.get_clock().now().nanoseconds == 5_000_000_000
    assert list(node.timers) == []
    assert "silent" not in capfd.readouterr().err


def test_first_time_ends_the_timeout(make_node: MakeNode) -> None:
    node = make_node(parameter_overrides=SIMULATED)
    node._time_source.clock_callback(ClockMsg(clock=TimeMsg(sec=5)))
    assert list(node.timers) == []


def test_timeout_ends_with_simulated_time(make_node: MakeNode) -> None:
    node = make_node(parameter_overrides=SIMULATED)
    set_use_sim_time(node, False)
    assert list(node.timers) == []
    set_use_sim_time(node, True)
    assert len(list(node.timers)) == 1
    node._time_source.detach_node()
    assert list(node.timers) == []


def test_system_time_needs_no_timeout(make_node: MakeNode) -> None:
    assert list(make_node().timers) == []


def test_simulated_time_that_ends_during_a_jump_stays_ended(clock: ROSClock) -> None:
    def end() -> None:  # as another thread may do
        clock._set_ros_time_is_active(False)

    clock._set_ros_time_is_active(True)
    threshold = JumpThreshold(min_forward=Duration(nanoseconds=1), min_backward=None, on_clock_change=False)
    jumps = clock.create_jump_callback(threshold, pre_callback=end)
    clock.set_ros_time_override(Time(seconds=10, clock_type=ClockType.ROS_TIME))
    jumps.unregister()
    assert not clock.ros_time_is_active
