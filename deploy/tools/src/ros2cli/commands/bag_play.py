"""`ros2 bag play`."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ros2cli import graph, rosbag2
from ros2cli.options import (
    NON_NEGATIVE_INT,
    FiniteFloat,
    ManyValues,
    VerbWithManyValues,
    bag_argument,
    qos_overrides_option,
    regular_expression,
)

if TYPE_CHECKING:
    from mcap.records import Message

    from rclpy.node import Node
    from rclpy.publisher import Publisher
    from rclpy.qos import QoSProfile

_POSITIVE = FiniteFloat(min=0, min_open=True)
_MATCHING_TIME = 0.5
"""How long the subscriptions that it has found may take to match before it plays [s]."""


@click.command(cls=VerbWithManyValues)
@bag_argument
@click.option(
    "-r", "--rate", type=_POSITIVE, default=1.0, show_default=True, help="Rate at which to play back."
)
@click.option("--topics", cls=ManyValues, metavar="TOPIC...", help="Topics to play.")
@click.option(
    "-e", "--regex", callback=regular_expression, help="Play only topics that match this expression."
)
@click.option(
    "-x", "--exclude-regex", callback=regular_expression, help="Do not play topics that match this."
)
@click.option("--exclude-topics", cls=ManyValues, metavar="TOPIC...", help="Topics not to play.")
@qos_overrides_option
@click.option("-l", "--loop", is_flag=True, help="Start again at the end, until Ctrl-C.")
@click.option("-m", "--remap", cls=ManyValues, metavar="OLD:=NEW...", help="Topics to be remapped.")
@click.option(
    "--clock",
    type=_POSITIVE,
    is_flag=False,
    flag_value=40.0,
    help="Publish to /clock at this frequency in Hz (40 without a value); a recorded /clock is not played.",
)
@click.option(
    "-d",
    "--delay",
    type=FiniteFloat(min=0),
    default=0.0,
    help="Sleep before the first play, in s.",
)
@click.option("--playback-duration", type=FiniteFloat(), default=-1.0, help="Playback duration in seconds.")
@click.option(
    "--playback-until-sec",
    type=FiniteFloat(),
    default=-1.0,
    help="Playback until this time [s since 1970].",
)
@click.option("--playback-until-nsec", type=int, default=-1, help="The same in nanoseconds since epoch.")
@click.option(
    "--start-offset", type=FiniteFloat(min=0), default=0.0, help="Start this many seconds into the bag."
)
@click.option(
    "--wait-for-all-acked",
    metavar="TIMEOUT",
    type=NON_NEGATIVE_INT,
    default=500,
    show_default=True,
    help="Wait at the end until reliable subscriptions have all, at most this time in ms; 0: forever.",
)
def play(
    bag_path: str,
    clock: float | None,
    delay: float,
    loop: bool,
    remap: tuple[str, ...],
    wait_for_all_acked: int,
    **options: Any,
) -> None:
    """Play back ROS data from a bag, at the pace at which it was recorded."""
    from rclpy.duration import Duration

    metadata = rosbag2.read(Path(bag_path))
    for remark in metadata.remarks:
        click.echo(remark, err=True)
    overrides = rosbag2.qos_overrides(options["qos_profile_overrides_path"])
    arguments = ["--ros-args", *(word for rule in remap for word in ("--remap", rule))]
    with (
        graph.node(graph.default_spin_time(), name="rosbag2_player", arguments=arguments) as node,
        graph.spinning(node),
    ):
        topics = [topic for topic in metadata.topics if _is_wanted(topic.name, options, bool(clock))]
        publishers = _publishers(node, topics, overrides)
        graph.wait_for(lambda: _are_matched(node, publishers), _MATCHING_TIME)
        player = _Player(node, metadata, publishers, options)
        try:
            time.sleep(delay)
            if clock:
                player.publish_clock(clock)
            while player.play() and loop:
                pass
        except KeyboardInterrupt:
            return
        timeout = Duration(nanoseconds=wait_for_all_acked * 10**6 or -1)
        for publisher in publishers.values():
            publisher.wait_for_all_acked(timeout)


def _is_wanted(topic: str, options: dict[str, Any], has_clock: bool) -> bool:
    included, regex = options["topics"], options["regex"]
    if (included or regex) and topic not in included and not (regex and re.search(regex, topic)):
        return False
    excluded = options["exclude_regex"] and re.search(options["exclude_regex"], topic)
    return not excluded and topic not in options["exclude_topics"] and not (has_clock and topic == "/clock")


def _publishers(
    node: Node, topics: list[rosbag2.Topic], overrides: dict[str, QoSProfile]
) -> dict[str, Publisher]:
    made = {}
    for topic in topics:
        try:
            if topic.encoding != "cdr":
                raise RuntimeError(f"its messages are encoded as '{topic.encoding}', not as 'cdr'")
            class_ = graph.interface_class("message", topic.type, f"its type '{topic.type}' is unknown")
        except RuntimeError as error:
            node.get_logger().warn(f"Ignoring a topic '{topic.name}', reason: {error}.")
            continue
        profile = overrides.get(topic.name) or _adapted(node, topic)
        made[topic.name] = node.create_publisher(class_, topic.name, profile)
    return made


def _adapted(node: Node, topic: rosbag2.Topic) -> QoSProfile:
    """The QoS of the recorded publishers if it was the same for all, otherwise the default."""
    from rclpy.qos import HistoryPolicy, QoSProfile

    relevant = ("reliability", "durability", "deadline", "liveliness", "liveliness_lease_duration")
    first, *others = topic.offered or [QoSProfile(depth=10)]
    if any(getattr(other, policy) != getattr(first, policy) for other in others for policy in relevant):
        node.get_logger().warn(
            f"Not all original publishers on topic {topic.name} offered the same QoS profiles."
            " Falling back to the default publisher offer."
        )
        first = QoSProfile(depth=10)
    first.history, first.depth = HistoryPolicy.KEEP_LAST, 10
    return first


def _are_matched(node: Node, publishers: dict[str, Publisher]) -> bool:
    """Whether all known subscriptions have matched, so that they miss no message."""
    return all(
        publisher.get_subscription_count() >= node.count_subscribers(publisher.topic_name)
        for publisher in publishers.values()
    )


class _Player:
    def __init__(
        self,
        node: Node,
        metadata: rosbag2.Metadata,
        publishers: dict[str, Publisher],
        options: dict[str, Any],
    ) -> None:
        self._node = node
        self._files = metadata.paths()
        self._publishers = publishers
        self._rate = options["rate"]
        self._start = metadata.start + int(options["start_offset"] * 1e9)
        duration, until = options["playback_duration"], options["playback_until_nsec"]
        if options["playback_until_sec"] >= 0:
            until = int(options["playback_until_sec"] * 1e9)
        ends = [self._start + int(duration * 1e9)] if duration >= 0 else []
        ends += [until] if until >= 0 else []
        self._end = max(ends, default=metadata.start + metadata.duration)
        self._began: float | None = None

    def publish_clock(self, frequency: float) -> None:
        """Publish the time of the record on ``/clock``, at a frequency [Hz] of real time."""
        from rclpy.clock import Clock, ClockType
        from rclpy.time import Time
        from rosgraph_msgs.msg import Clock as ClockMessage

        publisher = self._node.create_publisher(ClockMessage, "/clock", 1)

        def publish() -> None:
            if self._began is None:
                return
            now = self._start + int((time.monotonic() - self._began) * self._rate * 1e9)
            publisher.publish(ClockMessage(clock=Time(nanoseconds=min(now, self._end)).to_msg()))

        self._node.create_timer(1.0 / frequency, publish, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def play(self) -> bool:
        """Play once; return whether there was a message to play."""
        messages = self._messages()
        first = next(messages, None)  # to open a file takes its time
        if first is None:
            return False
        began = self._began = time.monotonic()
        for topic, message in chain([first], messages):
            due = began + (message.log_time - self._start) / (self._rate * 1e9)
            time.sleep(max(0.0, due - time.monotonic()))
            try:
                self._publishers[topic].publish(message.data)
            except Exception as error:  # of any type, by the runtime: the message is unreadable
                self._node.get_logger().error(f"Failed to publish a message on '{topic}': {error}")
        return True

    def _messages(self) -> Iterator[tuple[str, Message]]:
        from mcap_files import McapFile, UnreadableError

        for path in self._files:
            try:
                with McapFile(path) as file:
                    for channel, message in file.messages(list(self._publishers), self._start, self._end):
                        yield channel.topic, message
            except UnreadableError as error:
                raise click.ClickException(str(error)) from None
            except OSError as error:
                raise click.ClickException(f"'{path}' cannot be read: {error.strerror}") from None
