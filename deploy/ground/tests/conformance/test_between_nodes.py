"""Parameters of the command line, and logs, as another node sees them."""

from __future__ import annotations

from pathlib import Path

import pytest
from deploy.ground.tests.conformance.middleware import announced_history
from deploy.ground.tests.nodes import MakeNode, SpinUntil
from rcl_interfaces.msg import Log
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Float64


@pytest.fixture
def asking(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    node = make_node("asking", namespace="/arm")
    executor.add_node(node)
    return node


def test_parameter_names_contain_the_entity_id_and_the_remapped_topic(
    make_node: MakeNode, asking: Node, spin_until: SpinUntil
) -> None:
    arguments = ["-r", "x:=y", "-p", "qos_overrides./arm/y.publisher_left.depth:=9"]
    node = make_node("node", namespace="/arm", cli_args=["--ros-args", *arguments])
    options = QoSOverridingOptions.with_default_policies(entity_id="left")
    publisher = node.create_publisher(Float64, "x", QoSProfile(depth=1), qos_overriding_options=options)
    assert publisher.topic_name == "/arm/y"
    spin_until(lambda: asking.get_publishers_info_by_topic("y"))
    qos = asking.get_publishers_info_by_topic("y")[0].qos_profile
    assert (qos.history, qos.depth) == announced_history(9)
    assert node.get_parameter("qos_overrides./arm/y.publisher_left.depth").value == 9


def test_log_messages_of_a_node_are_published_on_rosout(
    make_node: MakeNode, asking: Node, spin_until: SpinUntil, capfd: pytest.CaptureFixture[str]
) -> None:
    server = make_node("server", namespace="/arm")
    heard: list[Log] = []
    latched = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    asking.create_subscription(Log, "/rosout", heard.append, latched)
    before = server.get_clock().now().nanoseconds
    server.get_logger().debug("not loud enough")
    server.get_logger().warning("the arm ist müde")
    server.get_logger().get_child("joint").error("it hurts")
    spin_until(lambda: len(heard) >= 2)
    warning, error = heard
    assert (warning.name, warning.level, warning.msg) == ("arm.server", 30, "the arm ist müde")
    assert (error.name, error.level, error.msg) == ("arm.server.joint", 40, "it hurts")
    assert Path(warning.file).name == Path(__file__).name
    assert warning.function == "test_log_messages_of_a_node_are_published_on_rosout"
    assert 0 < warning.line < error.line
    for message in heard:
        stamp = message.stamp.sec * 10**9 + message.stamp.nanosec
        assert before <= stamp <= server.get_clock().now().nanoseconds
    assert "the arm ist müde" in capfd.readouterr().err
