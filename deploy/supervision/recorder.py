"""Writes the messages of an arm to an MCAP of ROS 2 messages, which Foxglove and `ros2 bag` open.

The log time of a message is its reception, the publish time its DDS source time.
"""

from __future__ import annotations

import json
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Mapping
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Protocol

import reactivex as rx
import ros_yaml
from mcap_files import FileWriter
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import String

from interfaces import topics
from reactive_node import ReactiveNode
from reactive_node.sampled_reader import sampled_messages

METADATA = "reactive-arm"
DEPTH = 200  # messages that may wait while the recorder is not scheduled
HEARTBEAT_PERIOD = 0.05  # s; the switch sends one heartbeat in it
HEARTBEAT_DEPTH = 10  # as many are read at once; more than one if the recorder was not scheduled
LOOK_PERIOD = 1.0  # s between two looks for topics of a user's manifest
ANY_PUBLISHER = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)
"""The QoS that meets every publisher."""
OF_EACH_NODE = {"/rosout", "/parameter_events"}
_ONE_MOMENT = 100_000  # ns within which both clocks are read


def clocks() -> tuple[int, int]:
    """Return one moment on the monotonic clock and since 1970 [ns]."""
    while True:
        before, epoch, after = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
        if after - before < _ONE_MOMENT:  # otherwise, the thread has paused in between
            return before, epoch


class Sink(Protocol):
    """Takes the messages of :func:`record`; times are those of the monotonic clock [ns]."""

    def monotonic(self, time_of_day: int, moment: tuple[int, int]) -> int: ...

    def knows(self, type_name: str) -> bool: ...

    def message(
        self, topic: str, type_name: str, qos: str, data: bytes, received: int, sent: int
    ) -> None: ...


class Recorder:
    """A file of messages. Thread-safe."""

    def __init__(self, path: Path, monotonic: int, epoch: int) -> None:
        """:param monotonic, epoch: the same moment on the monotonic clock and since 1970 [ns].
        :raises OSError: like all methods, if the disk does not take the messages.
        """
        self._writer = FileWriter(path, "reactive-arm")
        self._origin = monotonic
        self._offset = epoch - monotonic
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._lock = threading.Lock()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        self._writer.add_metadata(METADATA, {"origin": str(self._origin + self._offset)})

    def monotonic(self, time_of_day: int, moment: tuple[int, int]) -> int:
        """Convert a time since 1970 to the monotonic clock [ns].

        :param moment: what :func:`clocks` returns. The error of reading two clocks changes no time: replayed
            velocities follow from the differences of source times.
        """
        now, epoch = moment
        set_by = round(epoch - now - self._offset, -6)  # to ms
        return time_of_day - self._offset - set_by

    def message(self, topic: str, type_name: str, qos: str, data: bytes, received: int, sent: int) -> None:
        """Record a serialized message; without effect after :meth:`close`. Times: monotonic clock [ns]."""
        with self._lock:
            if not self._writer.is_open:
                return
            if topic not in self._channels:
                self._add(topic, type_name, qos)
            self._counts[topic] += 1
            self._writer.add_message(
                self._channels[topic],
                log_time=received + self._offset,
                data=data,
                publish_time=max(0, sent + self._offset),
                sequence=self._counts[topic],
            )

    def event(self, topic: str, time: int, event: Mapping[str, object]) -> None:
        data = serialize_message(String(data=json.dumps(event)))
        self.message(topic, "std_msgs/msg/String", "", data, time, time)

    def knows(self, type_name: str) -> bool:
        """Return whether a record can describe a type, and this process can read it."""
        package, *_ = type_name.split("/")
        return type_name in self._types.fielddefs and find_spec(package) is not None

    @property
    def count(self) -> int:
        return self._counts.total()

    @property
    def size(self) -> int:
        """The bytes that are written, or wait for it."""
        return self._writer.size

    def save(self) -> None:
        """Bring everything so far to the disk; called every ``SAVE_PERIOD``, it limits what a death costs."""
        with self._lock:
            self._writer.save()

    def close(self) -> None:
        with self._lock:
            self._writer.close()

    def _add(self, topic: str, type_name: str, qos: str) -> None:
        if type_name not in self._schemas:
            definition, _ = self._types.generate_msgdef(type_name, ros_version=2)
            self._schemas[type_name] = self._writer.register_schema(type_name, "ros2msg", definition.encode())
        self._channels[topic] = self._writer.register_channel(
            topic, "cdr", self._schemas[type_name], {"offered_qos_profiles": qos}
        )


def qos_profiles(topic: topics.Topic) -> str:
    """Return the QoS of a topic in the form of rosbag2."""
    latched, lifespan = topics.is_latched(topic.qos), topic.qos.lifespan.nanoseconds
    profile = {
        "history": 1,
        "depth": topic.qos.depth,
        "reliability": int(topic.qos.reliability),
        "durability": 1 if latched else 2,
        "deadline": {"sec": 0, "nsec": 0},
        "lifespan": {"sec": lifespan // 10**9, "nsec": lifespan % 10**9},
        "liveliness": 1,
        "liveliness_lease_duration": {"sec": 0, "nsec": 0},
        "avoid_ros_namespace_conventions": False,
    }
    return ros_yaml.dump([profile])


def record(
    node: ReactiveNode,
    recorder: Sink,
    first: Callable[[str], None] = lambda name: None,
    lost: Callable[[float, float], None] = lambda begin, end: None,
    is_foreign: Callable[[topics.Topic, bytes], bool] = lambda topic, data: False,
) -> None:
    """Record all topics of the contract in the namespace of a node, for as long as the node is spun.

    Of the heartbeats between two looks, 50 ms apart, the newest ten are recorded: a flood of them would
    otherwise take the processor from the services.

    :param first: is called with the name of each topic at its first message.
    :param lost: is called if the middleware has lost messages, with the begin and the end of the time in
        which they were sent, on the monotonic clock [s]. Lost heartbeats do not count: a flood has too many.
    :param is_foreign: whether a message has a number of another publisher than the contract's.
    """
    for topic in topics.CONTRACT:
        write = _writer(node, topic, recorder, first)
        if topic is topics.OPERATOR_HEARTBEAT:
            _record_newest(node, topic, write)
        else:
            _record_all(node, topic, write, lost, is_foreign)


def record_others(node: ReactiveNode, recorder: Sink, programs: Collection[str]) -> None:
    """Record besides the contract what programs publish or read: those of a user's manifest.

    A topic is recorded from the first look at which it exists; of one type, and that of common_interfaces.
    """
    known = {node.resolve_topic_name(topic.name) for topic in topics.ROWS} | OF_EACH_NODE

    def look(_: Any) -> None:
        for name, types in node.topic_types().items():
            if name in known or not _is_of(node, name, programs):
                continue
            known.add(name)
            if not recorder.knows(types[0]):
                node.get_logger().warning(f"{name} is not recorded: nothing describes {types[0]}")
                continue
            package, folder, kind = types[0].split("/")
            type_ = getattr(import_module(f"{package}.{folder}"), kind)
            topic = topics.Topic(name, type_, ANY_PUBLISHER, "", (), (), "")
            _record_all(node, topic, _writer(node, topic, recorder, lambda _: None))

    rx.timer(0.0, LOOK_PERIOD, node.scheduler).subscribe(look)


def _is_of(node: ReactiveNode, topic: str, programs: Collection[str]) -> bool:
    ends = (*node.publishers_of(topic), *node.subscribers_of(topic))
    return any(end.node in programs and end.namespace == node.get_namespace() for end in ends)


def _writer(
    node: ReactiveNode, topic: topics.Topic, recorder: Sink, first: Callable[[str], None]
) -> Callable[[bytes, int], int]:
    """Return what records a message and its source time [ns since 1970], and returns its reception [ns]."""
    name, offered = node.resolve_topic_name(topic.name), qos_profiles(topic)
    too_large = f"{name}: messages of more than {topic.largest} octets are not recorded, as none reads them"
    is_first = True

    def write(data: bytes, source_time: int) -> int:
        nonlocal is_first
        if len(data) > topic.largest:
            node.get_logger().warning(too_large, once=True)
            return clocks()[0]
        if is_first:
            first(name)
            is_first = False
        moment = clocks()
        sent = recorder.monotonic(source_time, moment)
        recorder.message(name, topic.type_name, offered, data, moment[0], sent)
        return moment[0]

    return write


def _qos(topic: topics.Topic, depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, reliability=topic.qos.reliability, durability=topic.qos.durability)


def _record_newest(node: ReactiveNode, topic: topics.Topic, write: Callable[[bytes, int], int]) -> None:
    qos = _qos(topic, HEARTBEAT_DEPTH)
    create = partial(node.create_subscription, topic.type, topic.name, lambda _: None, qos, raw=True)
    ticks = rx.timer(0.0, HEARTBEAT_PERIOD, node.scheduler)
    heartbeats = sampled_messages(node, create, ticks, timestamped=True, most=HEARTBEAT_DEPTH)
    heartbeats.starmap(write).subscribe()


def _record_all(
    node: ReactiveNode,
    topic: topics.Topic,
    write: Callable[[bytes, int], int],
    lost: Callable[[float, float], None] = lambda begin, end: None,
    is_foreign: Callable[[topics.Topic, bytes], bool] = lambda topic, data: False,
) -> None:
    # The loss is reported before or after the next message is: the one before both is among the last two.
    last_two: deque[int] = deque(maxlen=2)
    # Each publisher has numbers of its own; Cyclone DDS has none.
    is_numbered = len(topic.publishers) == 1 and topic is not topics.DIAGNOSTICS
    last_number: int | None = None

    def receive(data: bytes, info: Any) -> None:
        nonlocal last_number
        last_two.append(write(data, info["source_timestamp"]))
        if is_foreign(topic, data):
            return
        number = info["publication_sequence_number"] if is_numbered else None
        if last_number is not None and number is not None and number > last_number + 1:
            report_loss(info)  # Fast DDS does not report each one
        last_number = number

    def report_loss(_: Any) -> None:
        now = time.monotonic_ns()
        lost(min(last_two, default=now) / 1e9, now / 1e9)

    qos = _qos(topic, DEPTH)
    events = SubscriptionEventCallbacks(message_lost=report_loss)
    callback: Callable[..., None] = receive  # ROS 2's annotations do not know of the message's info
    node.create_subscription(topic.type, topic.name, callback, qos, raw=True, event_callbacks=events)
