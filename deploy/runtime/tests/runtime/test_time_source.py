"""Simulated time: what others reject, and what ends with its node or context."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest
from deploy.runtime.tests.conformance.test_time_source import clock_topics, use_sim_time

from builtin_interfaces.msg import Time as TimeMsg
from rcl_interfaces.msg import SetParametersResult
from rclpy import time_source
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.wait_for_message import wait_for_message
from rosgraph_msgs.msg import Clock as ClockMsg
from std_msgs.msg import String


def test_what_another_callback_rejects_does_not_happen(make_node: Callable[..., Node]) -> None:
    node = make_node()

    def reject(parameters: list[Parameter]) -> SetParametersResult:
        return SetParametersResult(successful=False, reason="not now")

    # The time source was there first, so it is asked last: ask it first.
    node._on_set_parameters_callbacks.append(reject)
    assert use_sim_time(node, True).reason == "not now"
    assert not node.get_clock().ros_time_is_active  # type: ignore[attr-defined]


def test_a_source_detached_from_its_node_follows_it_no_longer(make_node: Callable[..., Node]) -> None:
    node = make_node()
    source = node._time_source
    use_sim_time(node, True)
    source.detach_node()
    assert clock_topics(node) == []
    use_sim_time(node, False)
    assert source.ros_time_is_active


def test_waiting_ends_with_the_context(make_node: Callable[..., Node], context: Context) -> None:
    node = make_node()
    result: list[tuple[bool, Any]] = []
    thread = threading.Thread(target=lambda: result.append(wait_for_message(String, node, "silence")))
    thread.start()
    while thread.is_alive() and not list(node.subscriptions):
        thread.join(0.001)
    context.shutdown()
    thread.join(10)
    assert result == [(False, None)]


def test_waiting_ends_with_a_context_that_ends_before_it_has_begun(
    make_node: Callable[..., Node], context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_node()
    create_subscription = node.create_subscription

    def create_untimely(*args: Any, **options: Any) -> Any:
        subscription = create_subscription(*args, **options)
        context.shutdown()
        return subscription

    monkeypatch.setattr(node, "create_subscription", create_untimely)
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


def test_timeout_is_two_seconds_of_steady_time(make_node: Callable[..., Node]) -> None:
    (timer,) = make_node(parameter_overrides=SIMULATED).timers
    assert timer.timer_period_ns == 2_000_000_000
    assert timer.clock.clock_type == ClockType.STEADY_TIME


def test_silent_clock_topic_is_warned_of_once(
    timeout: float,
    make_node: Callable[..., Node],
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
    make_node: Callable[..., Node],
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


def test_first_time_ends_the_timeout(make_node: Callable[..., Node]) -> None:
    node = make_node(parameter_overrides=SIMULATED)
    node._time_source.clock_callback(ClockMsg(clock=TimeMsg(sec=5)))
    assert list(node.timers) == []


def test_timeout_ends_with_simulated_time(make_node: Callable[..., Node]) -> None:
    node = make_node(parameter_overrides=SIMULATED)
    use_sim_time(node, False)
    assert list(node.timers) == []
    use_sim_time(node, True)
    assert len(list(node.timers)) == 1
    node._time_source.detach_node()
    assert list(node.timers) == []


def test_system_time_needs_no_timeout(make_node: Callable[..., Node]) -> None:
    assert list(make_node().timers) == []
