"""How a process joins its DDS domain, and what travels on the wire."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from rclpy._dds import domain
from rclpy.context import Context
from rclpy.exceptions import InvalidHandle, RCLError
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import Float64, String

MakeNode = Callable[..., Node]
SpinUntil = Callable[..., None]
GOLDEN = json.loads((Path(__file__).parents[1] / "facts" / "cdr_golden.json").read_text())


def test_the_domain_is_0_unless_the_environment_says_otherwise() -> None:
    assert domain.domain_id_from_environment({}) == 0
    assert domain.domain_id_from_environment({"ROS_DOMAIN_ID": "42"}) == 42


@pytest.mark.parametrize("text", ["-1", "233", "one", "4.2"])
def test_a_domain_that_is_none_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(RCLError, match=r"^ROS_DOMAIN_ID must be a whole number from 0 to 232, not '"):
        domain.domain_id_from_environment({"ROS_DOMAIN_ID": text})


def test_localhost_uses_loopback_only() -> None:
    configuration = domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})
    assert '<NetworkInterface name="lo" multicast="true"/>' in configuration
    assert '<Peer address="localhost"/>' in configuration


def test_the_deprecated_localhost_only_variable_is_still_obeyed() -> None:
    old = domain.configuration({"ROS_LOCALHOST_ONLY": "1"})
    assert old == domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"})


def test_subnet_and_system_default_leave_cyclone_to_its_own_defaults() -> None:
    assert domain.configuration({}) == ""
    assert domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT"}) == ""


def test_off_hides_a_process_from_all_others() -> None:
    configuration = domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"})
    assert "<AllowMulticast>false</AllowMulticast>" in configuration
    assert "<Tag>ros_discovery_off_" in configuration


def test_static_peers_are_asked_besides() -> None:
    configuration = domain.configuration({"ROS_STATIC_PEERS": "robot1; 10.0.0.7"})
    assert '<Peer address="robot1"/><Peer address="10.0.0.7"/>' in configuration


def test_settings_of_cyclonedds_uri_come_last_and_win() -> None:
    own = "<CycloneDDS><Domain/></CycloneDDS>"
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "CYCLONEDDS_URI": own}
    assert domain.configuration(environment).endswith(f",{own}")


def test_network_interfaces_of_cyclonedds_uri_are_the_only_ones() -> None:
    interfaces = '<Interfaces><NetworkInterface name="lo"/></Interfaces>'
    own = f"<CycloneDDS><Domain><General>{interfaces}</General></Domain></CycloneDDS>"
    environment = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "CYCLONEDDS_URI": own}
    assert domain.configuration(environment).count("<NetworkInterface") == 1


def test_an_unknown_range_is_refused_in_one_line() -> None:
    with pytest.raises(RCLError, match=r"^ROS_AUTOMATIC_DISCOVERY_RANGE must be one of .*, not 'MOON'$"):
        domain.configuration({"ROS_AUTOMATIC_DISCOVERY_RANGE": "moon"})


def test_peers_that_are_no_addresses_are_refused() -> None:
    with pytest.raises(RCLError, match="ROS_STATIC_PEERS"):
        domain.configuration({"ROS_STATIC_PEERS": '"/><Evil'})


@pytest.mark.parametrize("name", ["float64", "float64_pi4"])
def test_on_the_wire_is_the_recorded_cdr(
    name: str, make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node = make_node()
    executor.add_node(node)
    received: list[bytes] = []
    node.create_subscription(Float64, "x", received.append, 10, raw=True)
    expected = bytes.fromhex(GOLDEN[name]["cdr"])
    publisher = node.create_publisher(Float64, "x", 10)
    publisher.publish(Float64._deserialize(expected))
    publisher.publish(expected)
    spin_until(lambda: len(received) == 2)
    assert received == [expected, expected]


def test_a_message_is_padded_on_the_wire_as_dds_wants_and_read_without(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node = make_node()
    executor.add_node(node)
    received: list[str] = []
    node.create_subscription(String, "x", lambda message: received.append(message.data), 10)
    publisher = node.create_publisher(String, "x", 10)
    for text in ("", "a", "ab", "abc", "Wrocław"):
        publisher.publish(String(data=text))
    spin_until(lambda: len(received) == 5)
    assert received == ["", "a", "ab", "abc", "Wrocław"]


def test_a_callback_with_two_arguments_learns_when_a_message_was_written(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node = make_node()
    executor.add_node(node)
    infos: list[dict[str, int]] = []
    node.create_subscription(Float64, "x", lambda message, info: infos.append(info), 10)
    before = time.time_ns()
    node.create_publisher(Float64, "x", 10).publish(Float64())
    spin_until(lambda: infos)
    assert before <= infos[0]["source_timestamp"] <= infos[0]["received_timestamp"] <= time.time_ns()


def test_only_the_last_messages_wait_for_a_slow_subscription(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node = make_node()
    executor.add_node(node)
    received: list[float] = []
    node.create_subscription(Float64, "x", lambda message: received.append(message.data), QoSProfile(depth=2))
    publisher = node.create_publisher(Float64, "x", 10)
    for number in range(10):
        publisher.publish(Float64(data=float(number)))
    spin_until(lambda: 9.0 in received)
    assert received == [8.0, 9.0]


def test_publishing_something_else_than_the_topics_type_is_a_type_error(make_node: MakeNode) -> None:
    publisher = make_node().create_publisher(Float64, "x", 10)
    with pytest.raises(TypeError, match="Expected std_msgs/msg/Float64 on /x, got String"):
        publisher.publish(String())


def test_publishing_after_the_end_is_an_error(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    destroyed = node.create_publisher(Float64, "x", 10)
    node.destroy_publisher(destroyed)
    with pytest.raises(InvalidHandle):
        destroyed.publish(Float64())
    publisher = node.create_publisher(Float64, "x", 10)
    context.shutdown()
    with pytest.raises(RCLError, match="/x: the context was shut down"):
        publisher.publish(Float64())


def test_other_threads_run_while_an_executor_waits(executor: SingleThreadedExecutor) -> None:
    counted = 0
    waiting = threading.Thread(target=executor.spin_once)
    waiting.start()
    while counted < 100_000:  # would take for ever if waiting held the interpreter lock
        counted += 1
    executor.wake()
    executor.shutdown()
    waiting.join(10)
    assert not waiting.is_alive()


def test_a_context_forgets_the_shutdown_callbacks_of_objects_that_are_gone(context: Context) -> None:
    class Listener:
        def hear(self) -> None: ...

    context.on_shutdown(Listener().hear)
    assert context._callbacks == []
