"""The file of a record: an MCAP of ROS 2 messages, which Foxglove and `ros2 bag` open.

The log time of a message is its reception by the observer, the publish time its DDS source time. Processes
and faults are recorded as JSON in std_msgs/String.
"""

from __future__ import annotations

import json
import struct
import threading
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.writer import Writer
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from std_msgs.msg import String

from deploy.chaos.babbler import is_babble
from deploy.chaos.history import History, InjectedFault, Life, Sample
from deploy.supervision.system import DeploymentError
from interfaces import topics

PROCESSES, FAULTS = "/chaos/processes", "/chaos/faults"  # topics
METADATA = "reactive-arm"


class Recorder:
    """Writes a record. Thread-safe."""

    def __init__(self, path: Path, monotonic: int, epoch: int) -> None:
        """:param monotonic, epoch: the same moment on the monotonic clock and since 1970 [ns]."""
        self._file = path.open("xb")
        self._writer = Writer(self._file)
        self._writer.start(profile="ros2", library="reactive-arm")
        self._origin = monotonic
        self._offset = epoch - monotonic
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._lock = threading.Lock()
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: Counter[str] = Counter()
        self._writer.add_metadata(METADATA, {"origin": str(self._origin + self._offset)})

    def message(self, topic: str, type_name: str, qos: str, data: bytes, received: int, sent: int) -> None:
        """Record a serialized message; without effect after :meth:`close`. Times: monotonic clock [ns]."""
        with self._lock:
            if self._file.closed:
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
        """Record an event of a process, or a fault, as JSON."""
        data = serialize_message(String(data=json.dumps(event)))
        self.message(topic, "std_msgs/msg/String", "", data, time, time)

    def close(self) -> None:
        """Complete the file."""
        with self._lock:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._file.close()

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
    return str(yaml.safe_dump([profile]))


@contextmanager
def _reader(path: Path) -> Iterator[McapReader]:
    """
    Open a record.

    :raises DeploymentError: if the file is incomplete or not a record.
    """
    try:
        with path.open("rb") as file:
            yield make_reader(file)
    except (McapError, struct.error) as error:  # struct.error: the file ends within a number
        raise DeploymentError(f"{path} is not a complete record: {error}") from None


def namespaces(path: Path) -> list[str]:
    """Return the namespaces of the arms in a record."""
    with _reader(path) as reader:
        events = reader.iter_messages(topics=[PROCESSES])
        found = {_event(message.data)["namespace"] for *_, message in events}
    return sorted(found, key=lambda namespace: (len(namespace), namespace))


def load(path: Path, namespace: str = "/") -> History:
    """Return the history of the arm in a namespace."""
    prefix = namespace.rstrip("/") + "/"
    names = {topic.name if topic.name[0] == "/" else prefix + topic.name: topic for topic in topics.CONTRACT}
    streams: dict[str, list[Sample]] = {topic.name: [] for topic in topics.CONTRACT}
    lives: dict[tuple[int, float], Life] = {}
    faults: list[InjectedFault] = []
    with _reader(path) as reader:
        origin = next(int(m.metadata["origin"]) for m in reader.iter_metadata() if m.name == METADATA)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        end = (summary.statistics.message_end_time - origin) / 1e9
        for _, channel, message in reader.iter_messages(topics=[*names, PROCESSES, FAULTS]):
            received, sent = ((t - origin) / 1e9 for t in (message.log_time, message.publish_time))
            if topic := names.get(channel.topic):
                streams[topic.name] += [
                    Sample(sent, received, value) for value in _values(topic, message.data, prefix)
                ]
            elif channel.topic in (PROCESSES, FAULTS):
                event = _event(message.data)
                if event.pop("namespace", namespace) != namespace:
                    continue
                if channel.topic == FAULTS:
                    event.pop("detail", None)  # of an older record; always empty
                    faults.append(InjectedFault(**event))
                else:
                    life = Life(**event)
                    lives[life.pid, life.began] = life
    for samples in streams.values():
        samples.sort()
    return History(
        end,
        streams,
        sorted(lives.values(), key=lambda life: life.began),
        sorted(faults, key=lambda f: f.begin),
    )


def _event(data: bytes) -> dict[str, Any]:
    event: dict[str, Any] = json.loads(deserialize_message(data, String).data)
    return event


def _values(topic: topics.Topic, data: bytes, prefix: str) -> list[Any]:
    """Return the content of a message as plain values; none for an injected one."""
    if is_babble(topic, data):
        return []
    try:
        message = deserialize_message(data, topic.type)
    except Exception:  # of any type, by the runtime: the message is unreadable
        return []
    if topic is topics.EFFECTOR_POSITION:
        return [(message.point.x, message.point.y)]
    if topic is topics.OPERATOR_PRESENCE:
        return [message.stamp.sec + message.stamp.nanosec / 1e9]
    if topic is not topics.DIAGNOSTICS:
        return [getattr(message, "data", None)]
    found = []
    for status in message.status:
        # The sentinel reports on other processes as `sentinel: NAME`; its report on itself counts as its own.
        reporter, _, subject = status.name.removeprefix(prefix).partition(": ")
        if status.name.startswith(prefix) and "/" not in reporter and subject in ("", reporter):
            found += [(reporter, int(pair.value)) for pair in status.values if pair.key == "pid"]
    return found
