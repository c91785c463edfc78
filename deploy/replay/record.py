"""Reads an MCAP of ROS 2 messages, of `make record`, `make chaos` or `ros2 bag record -s mcap`."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import IO, Any, NamedTuple

from mcap.reader import make_reader
from mcap.records import Channel
from rclpy.serialization import deserialize_message
from rclpy_simulation.host import SECOND

from deploy.chaos.record import FAULTS, PROCESSES, clock_offsets, read_event, time_sent
from deploy.recording.recorder import METADATA
from deploy.supervision.system import DeploymentError
from interfaces import topics
from interfaces.topics import Topic


class Message(NamedTuple):
    """A message and its DDS source time, on the time of day of the recorder."""

    sent: int
    """[ns since 1970]."""
    data: bytes
    """CDR with its encapsulation header."""


class Record(NamedTuple):
    """The messages of a record."""

    begin: int
    """Time of the first reception [ns since 1970]."""
    end: int
    """Time of the last reception."""
    origin: int
    """From which the events of the chaos monkey count their times [ns since 1970]."""
    messages: dict[str, list[Message]]
    """By full topic name, in the order of sending."""
    offsets: Collection[int] = ()
    """By which the chaos monkey has put the time of day of an arm forward [ns]."""

    def of(self, topic: Topic, namespace: str) -> list[Message]:
        """Return the messages of a topic of the arm in a namespace."""
        return self.messages.get(topic.full_name(namespace), [])

    def events(self, name: str, namespace: str) -> Iterator[Any]:
        """Yield the events of the chaos monkey that concern an arm: its processes or the faults."""
        for message in self.messages.get(name, ()):
            if (event := read_event(name, message.data, namespace)) is not None:
                yield event

    def namespaces(self) -> list[str]:
        """Return the namespaces of the arms."""
        relative = [f"/{topic.name}" for topic in topics.CONTRACT if topic.name[0] != "/"]
        found = {
            name.removesuffix(end) or "/" for name in self.messages for end in relative if name.endswith(end)
        }
        return sorted(found, key=lambda namespace: (len(namespace), namespace))


def text(message: Message, topic: Topic) -> str:
    """Return the content of a message; empty if it is unreadable."""
    try:
        return str(deserialize_message(message.data, topic.type).data)
    except Exception:  # of any type, by the runtime
        return ""


def load(path: Path) -> Record:
    """
    Read a record.

    :raises DeploymentError: if the file is damaged or incomplete, or contains no arm.
    """
    try:
        with path.open("rb") as file:
            record = _read(file)
    except OSError as error:
        raise DeploymentError(f"{path}: {error.strerror or error}") from None
    except Exception as error:  # of any type, by the parser or a decompressor
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DeploymentError(f"{path} is not a complete MCAP: {reason}") from None
    if record is None or not record.namespaces():
        raise DeploymentError(f"{path} contains no topic of an arm")
    return record


def _read(file: IO[bytes]) -> Record | None:
    """Read the topics of the contract, and the events of the chaos monkey; ``None`` without messages."""
    reader = make_reader(file, validate_crcs=True)
    summary = reader.get_summary()
    if summary is None or summary.statistics is None:
        raise ValueError("it has no summary")
    if not summary.statistics.message_count:
        return None
    wanted = [
        channel.topic
        for channel in summary.channels.values()
        if _is_wanted(channel, summary.schemas[channel.schema_id].name if channel.schema_id else "")
    ]
    read: defaultdict[str, list[tuple[int, int, bytes]]] = defaultdict(list)
    for _, channel, message in reader.iter_messages(wanted, log_time_order=False):
        stamp = message.publish_time or message.log_time
        read[channel.topic].append((message.log_time, stamp, message.data))
    offsets = [round(each * 1e9) for each in clock_offsets(data for *_, data in read[FAULTS])]
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
    origin = [int(each.metadata["origin"]) for each in reader.iter_metadata() if each.name == METADATA]
    begin, end = summary.statistics.message_start_time, summary.statistics.message_end_time
    return Record(begin, end, origin[0] if origin else begin, messages, offsets)


def _is_wanted(channel: Channel, type_name: str) -> bool:
    if channel.message_encoding != "cdr":
        return False
    if channel.topic in (PROCESSES, FAULTS):
        return True
    return any(
        type_name == topic.type_name and f"/{channel.topic}".endswith(f"/{topic.name}")
        for topic in topics.CONTRACT
    )
