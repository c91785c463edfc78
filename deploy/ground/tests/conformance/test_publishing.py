"""Publishing: the bytes on the wire, accepted values, and errors."""

from __future__ import annotations

import json
import struct
import threading
import time
from pathlib import Path

import pytest
from deploy.ground.tests.nodes import MakeNode, SpinUntil
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Header, String

GOLDEN = json.loads((Path(__file__).parents[1] / "facts" / "cdr_golden.json").read_text())


@pytest.mark.parametrize("name", ["float64", "float64_pi4"])
def test_the_wire_carries_the_recorded_cdr(name: str, spin_until: SpinUntil, node: Node) -> None:
    received: list[bytes] = []
    node.create_subscription(Float64, "x", received.append, 10, raw=True)
    expected = bytes.fromhex(GOLDEN[name]["cdr"])
    publisher = node.create_publisher(Float64, "x", 10)
    publisher.publish(deserialize_message(expected, Float64))
    publisher.publish(expected)
    spin_until(lambda: len(received) == 2)
    assert received == [expected, expected]


def test_the_wire_carries_nothing_behind_empty_sequences(spin_until: SpinUntil, node: Node) -> None:
    received: list[bytes] = []
    node.create_subscription(JointState, "x", received.append, 10, raw=True)
    header = Header(frame_id="abc")
    node.create_publisher(JointState, "x", 10).publish(JointState(header=header, position=[1.0]))
    spin_until(lambda: len(received) == 1)
    expected = struct.pack("<iII4sIIdII", 0, 0, 4, b"abc", 0, 1, 1.0, 0, 0)
    assert received == [b"\0\1\0\0" + expected]


def test_strings_of_any_length_arrive_despite_padding(spin_until: SpinUntil, node: Node) -> None:
    received: list[str] = []
    node.create_subscription(String, "x", lambda message: received.append(message.data), 10)
    publisher = node.create_publisher(String, "x", 10)
    for text in ("", "a", "ab", "abc", "Wrocław"):
        publisher.publish(String(data=text))
    spin_until(lambda: len(received) == 5)
    assert received == ["", "a", "ab", "abc", "Wrocław"]


def test_a_message_that_cannot_be_read_is_dropped(spin_until: SpinUntil, node: Node) -> None:
    received: list[Float64] = []
    node.create_subscription(Float64, "x", received.append, 10)
    publisher = node.create_publisher(Float64, "x", 10)
    for data in (b"\0\1\0\0bad", serialize_message(Float64(data=2.0))):
        publisher.publish(data)
    spin_until(lambda: received)
    assert received == [Float64(data=2.0)]


def test_a_callback_with_two_arguments_gets_the_timestamps(spin_until: SpinUntil, node: Node) -> None:
    infos: list[dict[str, int]] = []
    node.create_subscription(Float64, "x", lambda message, info: infos.append(info), 10)
    before = time.time_ns()
    node.create_publisher(Float64, "x", 10).publish(Float64())
    spin_until(lambda: infos)
    assert before <= infos[0]["source_timestamp"] <= infos[0]["received_timestamp"] <= time.time_ns()


def test_only_the_last_messages_wait_for_a_slow_subscription(spin_until: SpinUntil, node: Node) -> None:
    received: list[float] = []
    node.create_subscription(Float64, "x", lambda message: received.append(message.data), QoSProfile(depth=2))
    publisher = node.create_publisher(Float64, "x", 10)
    for number in range(10):
        publisher.publish(Float64(data=float(number)))
    spin_until(lambda: 9.0 in received)
    assert received == [8.0, 9.0]


def test_publishing_a_message_of_another_type_is_a_type_error(make_node: MakeNode) -> None:
    publisher = make_node().create_publisher(Float64, "x", 10)
    with pytest.raises(TypeError):
        publisher.publish(String())


def test_publishing_after_destruction_or_shutdown_is_an_error(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    destroyed = node.create_publisher(Float64, "x", 10)
    node.destroy_publisher(destroyed)
    with pytest.raises(InvalidHandle):
        destroyed.publish(Float64())
    publisher = node.create_publisher(Float64, "x", 10)
    context.shutdown()
    with pytest.raises(rclpy_implementation.RCLError):
        publisher.publish(Float64())
    with pytest.raises(rclpy_implementation.RCLError):
        publisher.wait_for_all_acked(Duration())


def test_other_threads_run_while_an_executor_waits(executor: SingleThreadedExecutor) -> None:
    counted = 0
    end = Future()
    waiting = threading.Thread(target=executor.spin_until_future_complete, args=(end,))
    waiting.start()
    while counted < 100_000:  # would never end if waiting held the interpreter lock
        counted += 1
    end.set_result(None)
    waiting.join(10)
    assert not waiting.is_alive()
