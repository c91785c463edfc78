"""Simulated time (``use_sim_time``, ``/clock``, clocks that follow it) and ``wait_for_message``."""

from __future__ import annotations

from typing import Any

import rclpy.logging
from builtin_interfaces.msg import Time as TimeMsg
from deploy.ground.tests.nodes import MakeNode, SpinUntil
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import ROSClock
from rclpy.clock_type import ClockType
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from rclpy.time_source import TimeSource
from rclpy.wait_for_message import wait_for_message
from rosgraph_msgs.msg import Clock as ClockMsg
from std_msgs.msg import String

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def set_use_sim_time(node: Node, value: object) -> SetParametersResult:
    return node.set_parameters([Parameter("use_sim_time", value=value)])[0]


def clock_topics(node: Node) -> list[str]:
    return [subscription.topic_name for subscription in node.subscriptions]


def test_a_clock_follows_an_active_time_source() -> None:
    source, clock = TimeSource(), ROSClock()
    source.attach_clock(clock)
    assert not clock.ros_time_is_active
    source.clock_callback(ClockMsg(clock=TimeMsg(sec=5)))
    assert clock.now() > Time(seconds=1_000_000, clock_type=ClockType.ROS_TIME)
    source.ros_time_is_active = True
    assert clock.ros_time_is_active
    assert clock.now() == Time(seconds=5, clock_type=ClockType.ROS_TIME)
    source.clock_callback(ClockMsg(clock=TimeMsg(sec=6)))
    assert clock.now().nanoseconds == 6_000_000_000
    source.ros_time_is_active = False
    assert not clock.ros_time_is_active


def test_a_node_follows_its_parameter_use_sim_time(make_node: MakeNode) -> None:
    node = make_node()
    assert node.get_parameter("use_sim_time").value is False
    assert set_use_sim_time(node, True).successful
    assert node.get_clock().ros_time_is_active  # type: ignore[attr-defined]
    assert node.get_clock().now().nanoseconds == 0
    assert clock_topics(node) == ["/clock"]
    assert set_use_sim_time(node, False).successful
    assert not node.get_clock().ros_time_is_active  # type: ignore[attr-defined]
    assert clock_topics(node) == []


def test_a_node_may_start_in_simulated_time(make_node: MakeNode) -> None:
    node = make_node(parameter_overrides=[Parameter("use_sim_time", value=True)])
    assert node.get_clock().now().nanoseconds == 0


def test_simulated_time_follows_the_clock_topic(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node, simulator = make_node(), make_node("simulator")
    executor.add_node(node)
    set_use_sim_time(node, True)
    publisher = simulator.create_publisher(ClockMsg, "/clock", 1)

    def at(seconds: int) -> bool:
        publisher.publish(ClockMsg(clock=TimeMsg(sec=seconds)))
        return node.get_clock().now().nanoseconds == seconds * 1_000_000_000

    for seconds in (10, 11, 5):
        spin_until(lambda: at(seconds))  # noqa: B023


def test_wait_for_message_needs_no_executor(make_node: MakeNode) -> None:
    publisher = make_node("talker").create_publisher(String, "chatter", LATCHED)
    publisher.publish(String(data="hello"))
    node = make_node()
    found, message = wait_for_message(String, node, "chatter", qos_profile=LATCHED, time_to_wait=10)
    assert (found, message) == (True, String(data="hello"))
    assert list(node.subscriptions) == []


def test_wait_for_message_ends_with_its_timeout(make_node: MakeNode) -> None:
    node = make_node()
    assert wait_for_message(String, node, "silence", time_to_wait=0.01) == (False, None)
    assert list(node.subscriptions) == []


def test_a_callback_of_the_node_may_call_wait_for_message(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    make_node("talker").create_publisher(String, "chatter", LATCHED).publish(String(data="hello"))
    node = make_node()
    results: list[tuple[bool, Any]] = []

    def wait() -> None:
        timer.cancel()
        results.append(wait_for_message(String, node, "chatter", qos_profile=LATCHED, time_to_wait=10))

    timer = node.create_timer(0.0, wait)
    executor.add_node(node)
    spin_until(lambda: results)
    assert results == [(True, String(data="hello"))]
    rclpy.logging.shutdown()
