"""What is replayed: the messages of MCAP files and rosbag2 directories, in one order."""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack
from heapq import heapify, heappop, heappush, heapreplace
from pathlib import Path
from typing import Any, NamedTuple

from mcap_files import McapFile, rosbag2
from mcap_files.definition import definition, fields
from rosidl_runtime_py.utilities import get_message

from rclpy_ground.messages import type_of
from rclpy_simulation.host import SECOND

WINDOW = 5 * SECOND
"""By which the order of a file or of stamps may differ from that of the log times [ns]."""
_STAMP = {0: struct.Struct(">iI"), 1: struct.Struct("<iI")}  # by the octet of the encapsulation header


class Recorded(NamedTuple):
    """A message. Times: ns since 1970."""

    time: int
    """When it was received."""
    topic: str
    data: bytes
    """CDR with its encapsulation header."""
    sent: int


class Bag:
    """Recorded files that are being read; close it by ``with``."""

    def __init__(self, paths: Iterable[Path]) -> None:
        """Read what the files contain. Raises UnreadableError and OSError."""
        self.topics: dict[str, rosbag2.Topic] = {}
        """By name."""
        self.remarks: list[str] = []
        """What of the files is not read, and why."""
        self._stack = ExitStack()
        self._files: list[McapFile] = []
        self._definitions: dict[str, bytes] = {}
        with ExitStack() as stack:
            for path in paths:
                metadata = rosbag2.read(path)
                for topic in metadata.topics:
                    if topic.encoding == "cdr" and not topic.is_service_event():
                        self.topics.setdefault(topic.name, topic)
                self.remarks += metadata.remarks
                self._files += [stack.enter_context(McapFile(each)) for each in metadata.paths()]
            self._stack = stack.pop_all()
        for file in self._files:
            for schema in file.schemas.values():
                if schema.encoding == "ros2msg":
                    self._definitions.setdefault(schema.name, schema.data)
        self._is_in_order = all(file.is_indexed for file in self._files)
        self.begin = min((file.start for file in self._files if file.counts), default=0)
        """The first log time [ns since 1970]."""
        self.end = max((file.end for file in self._files if file.counts), default=0)

    def __enter__(self) -> Bag:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def message_type(self, topic: rosbag2.Topic) -> Any:
        """Return the class of the messages of a topic. Raises ValueError if none is installed that fits."""
        try:
            found = get_message(topic.type)
        except (AttributeError, ImportError, TypeError, ValueError):
            raise ValueError(f"{topic.type} is not installed") from None
        recorded = self._definitions.get(topic.type, b"")
        if topic.type_hash:
            is_same = topic.type_hash == type_of(found)[1]
        else:
            installed = definition(topic.type)[1]
            is_same = not (recorded and installed) or _fields(topic, recorded) == _fields(topic, installed)
        if not is_same:
            raise ValueError(f"the definition of {topic.type} is not that of the installed package")
        return found

    def messages(
        self,
        topics: Collection[str] | None = None,
        begin: int | None = None,
        end: int | None = None,
        *,
        by_stamp: bool = False,
    ) -> Iterator[Recorded]:
        """Yield messages in the order of their log times.

        :param topics: whose messages are yielded; ``None`` for all.
        :param begin, end: the first and the last log time [ns].
        :param by_stamp: use the stamp of a header as the log time, where there is one near the log time.
        """
        found = self._merged(self.topics if topics is None else topics, begin, end)
        if by_stamp:
            return _sorted(self._stamped(found))
        return found if self._is_in_order else _sorted((message.time, message) for message in found)

    def _merged(self, topics: Collection[str], begin: int | None, end: int | None) -> Iterator[Recorded]:
        # A file is begun when its first message is due: those of a split bag follow one another.
        streams: list[tuple[int, int, Recorded | None, Iterator[Recorded]]] = [
            (file.start, number, None, self._of(file, topics, begin, end))
            for number, file in enumerate(self._files)
        ]
        heapify(streams)
        while streams:
            _, number, message, rest = streams[0]
            if message is not None:
                yield message
            if following := next(rest, None):
                heapreplace(streams, (following.time, number, following, rest))
            else:
                heappop(streams)

    def _of(
        self, file: McapFile, topics: Collection[str], begin: int | None, end: int | None
    ) -> Iterator[Recorded]:
        for channel, message in file.messages(topics, begin, end):
            topic = self.topics.get(channel.topic)
            if topic is not None and file.type_name(channel) == topic.type:
                sent = message.publish_time or message.log_time
                yield Recorded(message.log_time, topic.name, message.data, sent)

    def _stamped(self, messages: Iterable[Recorded]) -> Iterator[tuple[int, Recorded]]:
        stamps: dict[str, Callable[[Recorded], int]] = {}
        for message in messages:
            if message.topic not in stamps:
                has_header = _has_header(self.topics[message.topic])
                stamps[message.topic] = _stamp if has_header else lambda it: it.time
            time = stamps[message.topic](message)
            yield time, message


def _sorted(messages: Iterable[tuple[int, Recorded]]) -> Iterator[Recorded]:
    """Yield messages at other times, which differ from theirs by :data:`WINDOW` at most."""
    held: list[tuple[int, int, Recorded]] = []
    latest = 0
    for number, (time, message) in enumerate(messages):
        heappush(held, (time, number, message._replace(time=time)))
        latest = max(latest, message.time)
        while held and held[0][0] < latest - WINDOW:
            yield heappop(held)[2]
    while held:
        yield heappop(held)[2]


def _has_header(topic: rosbag2.Topic) -> bool:
    try:
        types = list(get_message(topic.type).get_fields_and_field_types().values())
    except (AttributeError, ImportError, TypeError, ValueError):
        return False
    return types[:1] == ["std_msgs/Header"]


def _stamp(message: Recorded) -> int:
    """Return the stamp of a header; the log time if they are far apart, as without a stamp."""
    if len(message.data) < 12:
        return message.time
    seconds, nanoseconds = _STAMP[message.data[1] & 1].unpack_from(message.data, 4)
    stamp: int = seconds * SECOND + nanoseconds
    return stamp if abs(stamp - message.time) <= WINDOW else message.time


def _fields(topic: rosbag2.Topic, text: bytes) -> dict[str, list[str]]:
    return fields(topic.type, text.decode(errors="replace"))
