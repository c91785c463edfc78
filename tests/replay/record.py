"""Reads an MCAP of ROS 2 messages, of `make record`, `make chaos` or `ros2 bag record -s mcap`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping
from itertools import islice, product
from pathlib import Path
from typing import Any, NamedTuple

from mcap_files import McapFile, UnreadableError
from rclpy.serialization import deserialize_message
from rclpy_simulation.host import SECOND

from deploy.supervision.errors import DeploymentError
from deploy.supervision.recorder import METADATA
from interfaces import topics
from interfaces.service.health import healths
from interfaces.topics import Topic
from tests.promises.observations import FAULTS, PROCESSES, clock_offsets, read_event, time_sent

_OUTPUTS = (
    topics.EFFECTOR_POSITION,
    topics.EFFECTOR_SPEED,
    topics.EFFECTOR_TWIST,
    topics.OPERATOR_PRESENCE,
    topics.OPERATOR_ACTIVITY,
    topics.ENGINES_STATE,
)
"""Topics that only services of an arm publish; other robots have joint states and a description as well."""


LONGEST = 100 * 3600 * SECOND
"""Longest record that is replayed [ns]: virtual time passes 100 to 700 times as fast as that of the day."""


class Message(NamedTuple):
    """A message and its DDS source time, on the time of day of the recorder."""

    sent: int
    """[ns since 1970]."""
    data: bytes
    """CDR with its encapsulation header."""


class Record(NamedTuple):
    begin: int
    """When the first message of an arm's services was received [ns since 1970]."""
    end: int
    """When the last one was received."""
    origin: int
    """From which the events of the chaos monkey count their times [ns since 1970]."""
    messages: dict[str, list[Message]]
    """By full topic name, in the order of sending."""
    offsets: Collection[int] = ()
    """By which the chaos monkey has put the time of day of an arm forward [ns]."""
    extents: Mapping[str, tuple[int, int]] = {}
    """Begin and end of each arm, by namespace."""
    remark: str = ""
    """How much of a file without an end was read; empty for a complete file."""

    def of_arm(self, namespace: str) -> Record:
        """Return the record with begin and end of the arm in a namespace."""
        begin, end = self.extents[namespace]
        return self._replace(begin=begin, end=end)

    def of(self, topic: Topic, namespace: str) -> list[Message]:
        return self.messages.get(topic.full_name(namespace), [])

    def events(self, name: str, namespace: str) -> Iterator[Any]:
        """Yield the events of the chaos monkey that concern an arm: its processes or the faults."""
        for message in self.messages.get(name, ()):
            if (event := read_event(name, message.data, namespace)) is not None:
                yield event

    def namespaces(self) -> list[str]:
        return _namespaces(self.messages)


def text(message: Message, topic: Topic) -> str:
    """Return the content of a message; empty if it is unreadable."""
    try:
        return str(deserialize_message(message.data, topic.type).data)
    except Exception:  # of any type, by the runtime
        return ""


def load(path: Path) -> Record:
    """Read the topics of the contract, and the events of the chaos monkey.

    :raises DeploymentError: if the file is damaged, or contains no arm.
    """
    try:
        with McapFile(path) as file:
            record = _read(file)
        for name, namespace in product((PROCESSES, FAULTS), record.extents):
            for _ in record.events(name, namespace):
                pass  # it is readable
    except OSError as error:
        raise DeploymentError(f"{path}: {error.strerror or error}") from None
    except UnreadableError as error:
        raise DeploymentError(str(error)) from None
    except (LookupError, RecursionError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise DeploymentError(f"{path} has events that no chaos monkey wrote: {reason}") from None
    if not record.extents:
        raise DeploymentError(f"{path} contains no topic of an arm")
    if record.end - record.begin > LONGEST:
        hours = [each // (3600 * SECOND) for each in (record.end - record.begin, LONGEST)]
        raise DeploymentError(f"{path} lasts {hours[0]} hours, more than the limit of {hours[1]} hours")
    return record


class _Received(NamedTuple):
    """A message as the file has it. Times: ns since 1970."""

    received: int
    stamp: int
    data: bytes


def _read(file: McapFile) -> Record:
    wanted = [
        channel.topic
        for channel in file.channels.values()
        if channel.message_encoding == "cdr" and _is_wanted(channel.topic, file.type_name(channel))
    ]
    read: defaultdict[str, list[_Received]] = defaultdict(list)
    for channel, message in file.kept(wanted):
        stamp = message.publish_time or message.log_time
        read[channel.topic].append(_Received(message.log_time, stamp, message.data))
    offsets = [round(each * 1e9) for each in clock_offsets(each.data for each in read[FAULTS])]
    messages = {
        topic: sorted(
            (
                Message(int(time_sent(received, stamp, offsets, SECOND)), data)
                for received, stamp, data in each
            ),
            key=lambda message: message.sent,
        )
        for topic, each in read.items()
        if each
    }
    extents = {namespace: _extent(read, namespace) for namespace in _namespaces(messages)}
    begin = min((begin for begin, _ in extents.values()), default=0)
    end = max((end for _, end in extents.values()), default=0)
    origin = [int(each.metadata["origin"]) for each in file.metadata if each.name == METADATA]
    return Record(begin, end, origin[0] if origin else begin, messages, offsets, extents, file.remark)


def _extent(read: Mapping[str, list[_Received]], namespace: str) -> tuple[int, int]:
    """Return when the first and the last message of an arm's services were received [ns since 1970].

    Anybody may publish the inputs of the services, /tf and /diagnostics, before the arm begins and after its
    end. They count only if the record has nothing else of the arm.
    """
    own = [read.get(topic.full_name(namespace), []) for topic in _OUTPUTS]
    times = [each[end].received for each in own if each for end in (0, -1)]
    reports = read.get(topics.DIAGNOSTICS.name, [])
    for ordered in (reports, reversed(reports)):
        times += islice((each.received for each in ordered if _is_health(each.data, namespace)), 1)
    if not times:
        relative = (topic.full_name(namespace) for topic in topics.CONTRACT if topic.name[0] != "/")
        times = [each.received for name in relative for each in read.get(name, [])]
    return min(times), max(times)


def _is_health(data: bytes, namespace: str) -> bool:
    """Return whether a message is the health of a service in a namespace."""
    try:
        message = deserialize_message(data, topics.DIAGNOSTICS.type)
    except Exception:  # of any type, by the runtime
        return False
    return bool(healths(message, namespace.rstrip("/")))


def _namespaces(names: Iterable[str]) -> list[str]:
    relative = [f"/{topic.name}" for topic in topics.CONTRACT if topic.name[0] != "/"]
    found = {name.removesuffix(end) or "/" for name in names for end in relative if name.endswith(end)}
    return sorted(found, key=lambda namespace: (len(namespace), namespace))


def _is_wanted(name: str, type_name: str) -> bool:
    if name in (PROCESSES, FAULTS):
        return True
    return any(
        type_name == topic.type_name and f"/{name}".endswith(f"/{topic.name}") for topic in topics.CONTRACT
    )
