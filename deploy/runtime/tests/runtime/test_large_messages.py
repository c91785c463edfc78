"""Large messages: no copy that can be avoided, and memory of DDS that is lent until a message is read."""

from __future__ import annotations

import copy
import os
import subprocess
import sys
import threading
import tracemalloc
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Barrier
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

from rclpy._dds import Participant, Reader, Writer, entities
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from rosidl_runtime_embedded import deserializer, fields, message_class, pieces, serializer
from rosidl_runtime_embedded.deserializer import make_deserializer
from rosidl_runtime_embedded.pieces import Pieces
from rosidl_runtime_embedded.serializer import make_serializer
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import ByteMultiArray, Float64MultiArray, UInt8MultiArray

from .fuzz import populated
from .test_bad_input import allocated
from .test_messages_codec import MESSAGES
from .test_reader import wait

MEGABYTE = 1_000_000
QOS = QoSProfile(depth=10)
TYPE_NAME = "std_msgs::msg::dds_::UInt8MultiArray_"


def image(size: int = MEGABYTE, octet: int = 7) -> Image:
    return Image(height=1, width=size, encoding="mono8", step=size, data=bytes([octet]) * size)


@contextmanager
def allocations() -> Iterator[Callable[[], int]]:
    """Measure the most memory that Python has allocated at once since the block began [octets]."""
    tracemalloc.start()
    try:
        yield lambda: tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


# Writing


@pytest.mark.parametrize("name", MESSAGES)
def test_pieces_are_the_octets_of_any_message(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cls: Any = message_class(name)
    expected = [(message, cls._serialize(message)) for message in (cls(), populated(name))]
    monkeypatch.setattr(serializer, "LARGE", 1)
    monkeypatch.setattr(pieces, "LARGE", 1)
    serialize = make_serializer(cls._DEFINITION, message_class)
    for message, octets in expected:
        assert bytes(serialize(message, Pieces)) == octets
        assert len(serialize(message, Pieces)) == len(octets)


def test_only_long_sequences_are_pieces() -> None:
    small: Any = UInt8MultiArray(data=bytes(pieces.LARGE - 1))
    assert type(small._serialize(small, Pieces)) is bytes
    large: Any = UInt8MultiArray(data=bytes(pieces.LARGE))
    assert type(large._serialize(large, Pieces)) is Pieces
    assert type(large._serialize(large)) is bytes


def test_read_only_octets_are_copied() -> None:
    octets = Pieces(b"beginning")
    octets += b"text" * pieces.LARGE
    assert not any(piece.readonly for piece in octets.pieces if isinstance(piece, memoryview))
    assert bytes(octets) == b"beginning" + b"text" * pieces.LARGE


@pytest.mark.parametrize("cls", [Image, PointCloud2, UInt8MultiArray, Float64MultiArray])
def test_publishing_copies_no_long_sequence(cls: Any, node: Node) -> None:
    publisher = node.create_publisher(cls, "x", 10)
    message = cls(data=array("d" if cls is Float64MultiArray else "B", bytes(8 * MEGABYTE)))
    publisher.publish(message)
    with allocations() as most:
        publisher.publish(message)
        assert most() < MEGABYTE


REPEATED = """
import resource
import rclpy
from std_msgs.msg import UInt8MultiArray

rclpy.init()
publisher = rclpy.create_node("node").create_publisher(UInt8MultiArray, "x", 10)
pixels = UInt8MultiArray(data=bytes(8_000_000)).data
for round in range(6):
    if round == 3:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    publisher.publish(UInt8MultiArray(data=pixels))
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_later_large_messages_take_no_new_memory(domain_id: int) -> None:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(domain_id), "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}
    pages = subprocess.check_output([sys.executable, "-c", REPEATED], env=environment, timeout=60)
    assert int(pages) < 1000  # of 2000 for each copy of the octets


def test_message_may_grow_while_its_publisher_waits(node: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    publisher = node.create_publisher(Image, "x", 10)
    message = image()
    write = entities.blocking.dds_writecdr

    def blocked(*arguments: Any) -> int:
        message.data.append(1)  # another thread
        return int(write(*arguments))

    monkeypatch.setattr(entities.blocking, "dds_writecdr", blocked)
    publisher.publish(message)
    assert len(message.data) == MEGABYTE + 1


# Reading


@pytest.fixture
def writer(participant: Participant) -> Writer:
    return participant.create_writer("rt/x", TYPE_NAME, QOS, "")


@pytest.fixture
def reader(participant: Participant) -> Reader:
    return participant.create_reader("rt/x", TYPE_NAME, QOS, "")


def lent(reader: Reader) -> Any:
    """Wait for a sample, and return its octets in the memory of DDS."""
    wait(reader)
    sample = reader.take(lend=True)
    assert sample is not None
    return sample.data


def octets(value: int) -> bytes:
    message: Any = UInt8MultiArray(data=bytes([value]) * MEGABYTE)
    return bytes(message._serialize(message))


def test_lent_octets_outlive_later_messages_and_the_reader(reader: Reader, writer: Writer) -> None:
    writer.write(octets(1))
    first = lent(reader)
    for value in range(2, 12):
        writer.write(octets(value))
        assert bytes(lent(reader)) == octets(value)
    reader.close()
    writer.close()
    assert bytes(first) == octets(1)


def test_lent_octets_outlive_the_participant(domain_id: int) -> None:
    participant = Participant(domain_id, "/")
    reader = participant.create_reader("rt/x", TYPE_NAME, QOS, "")
    participant.create_writer("rt/x", TYPE_NAME, QOS, "").write(octets(1))
    first = lent(reader)
    participant.close()
    assert bytes(first) == octets(1)
    del first  # and they may be freed


def test_lent_octets_are_returned_when_nothing_refers_to_them(
    reader: Reader, writer: Writer, monkeypatch: pytest.MonkeyPatch
) -> None:
    returned: list[int] = []
    give_back = entities.quick.ddsi_serdata_to_ser_unref
    monkeypatch.setattr(
        entities.quick,
        "ddsi_serdata_to_ser_unref",
        lambda serdata, vector: (returned.append(serdata), give_back(serdata, vector)),
    )
    writer.write(octets(1))
    part = lent(reader)[-4:]
    assert not returned
    assert bytes(part) == b"\1\1\1\1"
    del part
    assert len(returned) == 1


@pytest.mark.parametrize("name", MESSAGES)
def test_messages_in_lent_memory_are_equal_to_others(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    cls: Any = message_class(name)
    for module in (deserializer, serializer, pieces):
        monkeypatch.setattr(module, "LARGE", 1)
    deserialize = make_deserializer(cls._DEFINITION, message_class)
    serialize = make_serializer(cls._DEFINITION, message_class)
    for message in (cls(), populated(name)):
        octets = cls._serialize(message)
        received = deserialize(memoryview(bytearray(octets)))
        assert (serialize(received), bytes(serialize(received, Pieces))) == (octets, octets)
        assert copy.deepcopy(received) == received == message
        assert (serialize(received), bytes(serialize(received, Pieces))) == (octets, octets)


Pass = Callable[[Image], Image]


@pytest.fixture
def passed(node: Node, spin_until: SpinUntil) -> Pass:
    received: list[Image] = []
    node.create_subscription(Image, "x", received.append, 10)
    publisher = node.create_publisher(Image, "x", 10)
    spin_until(publisher.get_subscription_count)

    def pass_on(message: Image) -> Image:
        publisher.publish(message)
        spin_until(lambda: received)
        return received.pop()

    return pass_on


def test_reading_copies_a_long_sequence_once(passed: Pass) -> None:
    message = image(10 * MEGABYTE)
    passed(message)
    with allocations() as most:
        received = passed(message)
        assert most() < MEGABYTE
        received.data[0] = 0
        received.data.append(1)
        assert most() < 11 * MEGABYTE
    assert received.data == array("B", [0, *message.data[1:], 1])


def test_message_that_is_passed_on_unread_is_not_copied(passed: Pass) -> None:
    message = image(10 * MEGABYTE)
    received = passed(message)
    with allocations() as most:
        for _ in range(3):
            received = passed(received)
        assert most() < MEGABYTE
    assert received == message


def test_message_in_lent_memory_can_be_changed(passed: Pass) -> None:
    received = passed(image())
    received.data = bytes(3)
    received.width = 3
    assert passed(received).data == array("B", bytes(3))


def test_threads_that_read_a_message_first_get_one_array(
    passed: Pass, monkeypatch: pytest.MonkeyPatch
) -> None:
    received = passed(image())
    two = Barrier(2, timeout=10.0)  # s
    own_numbers = fields._own_numbers

    def own_together(*arguments: Any) -> Any:
        two.wait()
        return own_numbers(*arguments)

    monkeypatch.setattr(fields, "_own_numbers", own_together)
    read: list[Any] = []
    threads = [threading.Thread(target=lambda: read.append(received.data)) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert read[0] is read[1] is received.data


def test_octets_of_the_user_are_copied_from_memory_that_may_change() -> None:
    given = bytearray(octets(1))
    message = deserialize_message(memoryview(given), UInt8MultiArray)  # type: ignore[arg-type]
    given[-1] = 9
    assert message.data[-1] == 1


def test_readers_of_a_process_have_messages_of_their_own(node: Node, spin_until: SpinUntil) -> None:
    received: list[Image] = []
    for _ in range(2):
        node.create_subscription(Image, "x", received.append, 10)
    publisher = node.create_publisher(Image, "x", 10)
    spin_until(lambda: publisher.get_subscription_count() == 2)
    publisher.publish(image())
    spin_until(lambda: len(received) == 2)
    received[0].data[0] = 0
    assert received[1] == image()


def test_message_outlives_its_context(
    make_node: MakeNode, context: Context, spin_until: SpinUntil, executor: Any
) -> None:
    received: list[Image] = []
    node = make_node()
    executor.add_node(node)
    node.create_subscription(Image, "x", received.append, 10)
    publisher = node.create_publisher(Image, "x", 10)
    spin_until(publisher.get_subscription_count)
    publisher.publish(image())
    spin_until(lambda: received)
    node.destroy_node()
    context.shutdown()
    assert received == [image()]


def test_raw_subscription_gets_bytes(node: Node, spin_until: SpinUntil) -> None:
    received: list[bytes] = []
    node.create_subscription(Image, "x", received.append, 10, raw=True)
    publisher = node.create_publisher(Image, "x", 10)
    spin_until(publisher.get_subscription_count)
    publisher.publish(image())
    spin_until(lambda: received)
    assert type(received[0]) is bytes
    assert deserialize_message(received[0], Image) == image()
    publisher.publish(received[0])
    spin_until(lambda: len(received) == 2)
    assert received[0] == received[1]


def test_bytes_of_a_large_message_are_of_length_one(node: Node, spin_until: SpinUntil) -> None:
    received: list[ByteMultiArray] = []
    node.create_subscription(ByteMultiArray, "x", received.append, 10)
    publisher = node.create_publisher(ByteMultiArray, "x", 10)
    spin_until(publisher.get_subscription_count)
    message = ByteMultiArray(data=[b"a", b"b"] * pieces.LARGE)
    publisher.publish(message)
    spin_until(lambda: received)
    assert type(received[0].data[0]) is bytes
    assert received == [message]


def test_damaged_large_samples_are_dropped_and_leave_no_memory(
    node: Node, participant: Participant, spin_until: SpinUntil
) -> None:
    subscription = node.create_subscription(UInt8MultiArray, "x", lambda _: None, QOS)
    writer = participant.create_writer("rt/x", TYPE_NAME, QOS, "")
    spin_until(writer.matched)
    good = octets(1)
    damaged = [good[:-4], good[: MEGABYTE // 2], good[:4] + b"\xff" * (len(good) - 4)]

    def drop(samples: list[bytes]) -> None:
        for sample in samples:
            dropped = subscription._rclpy_bad_input.count + 1
            writer.write(sample)
            spin_until(lambda: subscription._rclpy_bad_input.count == dropped)  # noqa: B023, it is called at once

    drop(damaged)
    before = allocated()
    drop(damaged * 25)
    assert allocated() < before + 20_000


def test_threads_read_messages_at_the_same_time(make_node: MakeNode, context: Context) -> None:
    node = make_node()
    received: list[Image] = []
    done = Future()
    two = Barrier(2, timeout=10.0)  # s

    def receive(message: Image) -> None:
        two.wait()  # for a callback on another thread
        received.append(message)
        if len(received) == 8:
            done.set_result(None)

    node.create_subscription(Image, "x", receive, 10, callback_group=ReentrantCallbackGroup())
    publisher = node.create_publisher(Image, "x", 10)
    with MultiThreadedExecutor(4, context=context) as executor:
        executor.add_node(node)
        for octet in range(8):
            publisher.publish(image(octet=octet))
        executor.spin_until_future_complete(done, 20.0)
    assert sorted(message.data[0] for message in received) == list(range(8))
    assert all(message == image(octet=message.data[0]) for message in received)
