from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil
from geometry_msgs.msg import PointStamped
from rclpy.clock import ROSClock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from std_msgs.msg import String

from message_filters import (
    ApproximateTimeSynchronizer,
    Cache,
    SimpleFilter,
    Subscriber,
    TimeSynchronizer,
)


def at(seconds: float) -> Time:
    return Time(nanoseconds=round(seconds * 1e9), clock_type=ClockType.ROS_TIME)


def stamped(seconds: float, frame: str = "") -> PointStamped:
    message = PointStamped()
    message.header.stamp = at(seconds).to_msg()
    message.header.frame_id = frame
    return message


class Inputs:
    """Filters that the test feeds, and the stamps of what a synchronizer makes of it."""

    def __init__(self, count: int) -> None:
        self.filters = [SimpleFilter() for _ in range(count)]
        self.outputs: list[tuple[float, ...]] = []

    def feed(self, index: int, *stamps: float) -> None:
        for stamp in stamps:
            self.filters[index].signalMessage(stamped(stamp, f"input {index}"))

    def collect(self, *messages: PointStamped) -> None:
        assert [message.header.frame_id for message in messages] == [
            f"input {index}" for index in range(len(messages))
        ]
        self.outputs.append(
            tuple(message.header.stamp.sec + message.header.stamp.nanosec / 1e9 for message in messages)
        )


def test_a_filter_calls_its_callbacks_with_their_arguments() -> None:
    heard = []
    source = SimpleFilter()
    assert source.registerCallback(lambda *args: heard.append(args)) == 0
    assert source.registerCallback(lambda *args: heard.append(args), "more", 2) == 1
    source.signalMessage("one", "two")
    assert heard == [("one", "two"), ("one", "two", "more", 2)]


def test_a_subscriber_passes_the_messages_of_a_topic_on(node: Node, spin_until: SpinUntil) -> None:
    heard: list[str] = []
    subscriber = Subscriber(node, String, "words")
    subscriber.registerCallback(lambda message: heard.append(message.data))
    publisher = node.create_publisher(String, "words", 10)
    spin_until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(String(data="hello"))
    spin_until(lambda: heard == ["hello"])
    assert subscriber.getTopic() == "words"
    assert subscriber.topic_name == "/words"
    assert subscriber.qos_profile.depth == 10
    with pytest.raises(AttributeError):
        _ = subscriber.nothing


def test_a_subscriber_takes_the_options_of_a_subscription(make_node: MakeNode) -> None:
    qos = QoSProfile(depth=3, reliability=ReliabilityPolicy.BEST_EFFORT)
    subscriber = Subscriber(make_node(), String, "words", qos_profile=qos, raw=True)
    assert subscriber.sub.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert subscriber.raw


def test_a_cache_keeps_the_last_messages_and_passes_all_on() -> None:
    source, heard = SimpleFilter(), []
    cache = Cache(source, 3)
    cache.registerCallback(heard.append)
    assert cache.getLast() is cache.getLastestTime() is cache.getOldestTime() is None
    messages = [stamped(second) for second in range(5)]
    for message in messages:
        source.signalMessage(message)
    assert heard == messages
    assert (cache.getOldestTime(), cache.getLastestTime()) == (at(2), at(4))
    assert cache.getLast() is messages[4]
    assert cache.getInterval(at(1), at(3)) == messages[2:4]
    assert cache.getElemAfterTime(at(2.5)) is messages[3]
    assert cache.getElemAfterTime(at(4)) is messages[4]
    assert cache.getElemAfterTime(at(4.5)) is None
    assert cache.getElemBeforeTime(at(3.5)) is messages[3]
    assert cache.getElemBeforeTime(at(1.5)) is None
    with pytest.raises(AssertionError):
        cache.getInterval(at(3), at(1))


def test_a_cache_keeps_one_message_by_default() -> None:
    source = SimpleFilter()
    cache = Cache(source)
    for second in (1, 2):
        source.signalMessage(stamped(second))
    assert cache.getOldestTime() == at(2)


def test_a_message_without_a_header_is_cached_only_if_allowed() -> None:
    source = SimpleFilter()
    strict, tolerant = Cache(source, 5), Cache(source, 5, allow_headerless=True)
    before = ROSClock().now()
    source.signalMessage(String(data="no header"))
    assert strict.getLast() is None
    assert tolerant.getLast() == String(data="no header")
    latest = tolerant.getLastestTime()
    assert latest is not None
    assert before <= latest <= ROSClock().now()


def test_messages_with_equal_stamps_are_grouped() -> None:
    inputs = Inputs(3)
    TimeSynchronizer(inputs.filters, 10).registerCallback(inputs.collect)
    inputs.feed(0, 1.0, 2.0, 3.0)
    inputs.feed(1, 3.0, 2.0, 1.5)
    assert inputs.outputs == []
    inputs.feed(2, 2.0, 1.0, 3.0)
    assert inputs.outputs == [(2.0, 2.0, 2.0), (3.0, 3.0, 3.0)]
    inputs.feed(1, 1.0)
    assert inputs.outputs[2:] == [(1.0, 1.0, 1.0)]


def test_a_group_is_output_once() -> None:
    inputs = Inputs(2)
    TimeSynchronizer(inputs.filters, 10).registerCallback(inputs.collect)
    for _ in range(2):
        inputs.feed(0, 1.0)
    inputs.feed(1, 1.0)
    assert inputs.outputs == [(1.0, 1.0)]
    inputs.feed(1, 1.0)
    assert inputs.outputs == [(1.0, 1.0)]


@pytest.mark.parametrize("approximate", [False, True])
def test_the_oldest_messages_are_dropped_when_a_queue_is_full(approximate: bool) -> None:
    inputs = Inputs(2)
    synchronizer: TimeSynchronizer = (
        ApproximateTimeSynchronizer(inputs.filters, 2, 0.1)
        if approximate
        else TimeSynchronizer(inputs.filters, 2)
    )
    synchronizer.registerCallback(inputs.collect)
    inputs.feed(0, 2.0, 1.0, 3.0)
    inputs.feed(1, 1.0, 2.0, 3.0)
    assert inputs.outputs == [(2.0, 2.0), (3.0, 3.0)]


def test_messages_with_similar_stamps_are_grouped() -> None:
    inputs = Inputs(3)
    ApproximateTimeSynchronizer(inputs.filters, 10, 0.5).registerCallback(inputs.collect)
    inputs.feed(0, 1.0, 2.0)
    inputs.feed(1, 1.25, 2.25)
    inputs.feed(2, 3.0)
    assert inputs.outputs == []
    inputs.feed(2, 2.125)
    inputs.feed(2, 1.125)
    assert inputs.outputs == [(2.0, 2.25, 2.125), (1.0, 1.25, 1.125)]


def test_of_similar_stamps_the_closest_is_taken() -> None:
    inputs = Inputs(2)
    ApproximateTimeSynchronizer(inputs.filters, 10, 1.0).registerCallback(inputs.collect)
    inputs.feed(0, 1.0, 1.5, 1.875)
    inputs.feed(1, 1.625)
    assert inputs.outputs == [(1.5, 1.625)]


def test_all_stamps_of_a_group_are_similar() -> None:
    inputs = Inputs(3)
    ApproximateTimeSynchronizer(inputs.filters, 10, 0.5).registerCallback(inputs.collect)
    inputs.feed(0, 1.0)
    inputs.feed(1, 1.75)
    inputs.feed(2, 1.375)  # 0.375 from both, which are 0.75 apart
    assert inputs.outputs == []
    inputs.feed(0, 1.5)
    assert inputs.outputs == [(1.5, 1.75, 1.375)]


def test_stamps_that_differ_by_the_slop_are_not_similar() -> None:
    inputs = Inputs(2)
    ApproximateTimeSynchronizer(inputs.filters, 10, 0.5).registerCallback(inputs.collect)
    inputs.feed(0, 1.0)
    inputs.feed(1, 1.5)
    assert inputs.outputs == []
    inputs.feed(1, 1.25)
    assert inputs.outputs == [(1.0, 1.25)]


@pytest.mark.parametrize("allowed", [False, True])
def test_a_message_without_a_header_is_grouped_by_its_arrival_if_allowed(allowed: bool) -> None:
    with_header, without = SimpleFilter(), SimpleFilter()
    groups: list[Any] = []
    synchronizer = ApproximateTimeSynchronizer([with_header, without], 10, 60.0, allow_headerless=allowed)
    synchronizer.registerCallback(lambda *messages: groups.append(messages))
    message = PointStamped()
    message.header.stamp = ROSClock().now().to_msg()
    with_header.signalMessage(message)
    without.signalMessage(String(data="no header"))
    assert groups == ([(message, String(data="no header"))] if allowed else [])


def test_a_stamp_may_be_a_time_of_rclpy() -> None:
    inputs = [SimpleFilter(), SimpleFilter()]
    groups: list[Any] = []
    ApproximateTimeSynchronizer(inputs, 5, 0.5).registerCallback(lambda *group: groups.append(group))
    messages = [SimpleNamespace(header=SimpleNamespace(stamp=Time(seconds=second))) for second in (3, 3)]
    for source, message in zip(inputs, messages, strict=True):
        source.signalMessage(message)
    assert groups == [tuple(messages)]


def test_callbacks_of_a_synchronizer_get_their_arguments() -> None:
    inputs = [SimpleFilter(), SimpleFilter()]
    groups: list[Any] = []
    TimeSynchronizer(inputs, 5).registerCallback(lambda *group: groups.append(group), "more")
    for source in inputs:
        source.signalMessage(stamped(1.0))
    assert groups == [(stamped(1.0), stamped(1.0), "more")]


def test_a_synchronizer_takes_subscribers(node: Node, spin_until: SpinUntil) -> None:
    groups: list[Any] = []
    topics = ["left", "right"]
    subscribers = [Subscriber(node, PointStamped, topic) for topic in topics]
    TimeSynchronizer(subscribers, 5).registerCallback(lambda *group: groups.append(group))
    publishers = [node.create_publisher(PointStamped, topic, 10) for topic in topics]
    spin_until(lambda: all(publisher.get_subscription_count() == 1 for publisher in publishers))
    for topic, publisher in zip(topics, publishers, strict=True):
        publisher.publish(stamped(4.0, topic))
    spin_until(lambda: groups)
    assert [message.header.frame_id for message in groups[0]] == topics
