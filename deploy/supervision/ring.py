"""Keeps the last minutes of an arm in short records, and what surrounds each stop of its engines.

The disk that they take is bounded: when a record is full, the next one begins, and of too many the oldest
goes. Each can be read alone: it begins with the last message of each latched topic.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import NamedTuple

from deploy.supervision.recorder import Recorder
from deploy.supervision.run_directory import STOP_RECORD

PART = 60 * 10**9  # ns of a record of the last minutes
BEFORE, AFTER = 30 * 10**9, 10 * 10**9  # ns around a stop
LARGEST = 32_000_000  # bytes of a record, and of what is kept in memory for the next stop
MOST_STOPS = 50
RING = "ring"  # in the folder of the records: the last minutes
_OBJECT = 300  # bytes of memory that a message takes beside its content


class Message(NamedTuple):
    topic: str
    type_name: str
    qos: str
    data: bytes
    received: int
    """When, on the monotonic clock [ns]."""
    sent: int

    @property
    def cost(self) -> int:
        return len(self.data) + _OBJECT


class Ring:
    """Stands in for a :class:`Recorder`. Thread-safe; its methods raise OSError as those of a recorder do."""

    def __init__(
        self, folder: Path, minutes: int, latched: Collection[str], monotonic: int, epoch: int
    ) -> None:
        """Keep the last minutes in `folder`/ring, and a record of each stop in `folder`.

        :param latched: the names of the latched topics.
        :param monotonic, epoch: the same moment on the monotonic clock and since 1970 [ns].
        """
        self._folder = folder
        self._minutes = minutes
        self._latched = latched
        self._offset = epoch - monotonic
        self._lock = threading.Lock()
        self._recent: deque[Message] = deque()
        self._recent_cost = 0
        self._before: dict[str, Message] = {}  # the last messages of latched topics before the recent ones
        self.count = 0
        (folder / RING).mkdir(exist_ok=True)
        self._part, self._part_ends = self._begin(folder / RING, monotonic, ()), monotonic + PART
        self._stop: Recorder | None = None
        self._stop_ends = 0

    def monotonic(self, time_of_day: int, moment: tuple[int, int]) -> int:
        return self._part.monotonic(time_of_day, moment)

    def knows(self, type_name: str) -> bool:
        return self._part.knows(type_name)

    def message(self, topic: str, type_name: str, qos: str, data: bytes, received: int, sent: int) -> None:
        message = Message(topic, type_name, qos, data, received, sent)
        with self._lock:
            self._end_what_is_due(received)
            self.count += 1
            self._part.message(*message)
            if self._stop:
                self._stop.message(*message)
            self._remember(message)

    def stop(self, now: int) -> None:
        """Note a stop of the engines [ns, monotonic clock]: keep the messages before and after it."""
        with self._lock:
            self._end_what_is_due(now)
            self._stop_ends = now + AFTER
            if self._stop:
                return
            begin = self._recent[0].received if self._recent else now
            state = [message._replace(received=begin) for message in self._before.values()]
            self._stop = self._begin(self._folder, now, (*state, *self._recent), STOP_RECORD)
            self._stop.save()
            _remove_oldest(self._folder, f"{STOP_RECORD}*.mcap", MOST_STOPS)

    def save(self) -> None:
        with self._lock:
            self._part.save()
            if self._stop:
                self._stop.save()

    def close(self) -> None:
        with self._lock:
            self._part.close()
            if self._stop:
                self._stop.close()

    def _end_what_is_due(self, now: int) -> None:
        if now >= self._part_ends or self._part.size >= LARGEST:
            self._part.close()
            recent = {message.topic: message for message in self._recent if message.topic in self._latched}
            state = [message._replace(received=now) for message in (self._before | recent).values()]
            self._part, self._part_ends = self._begin(self._folder / RING, now, state), now + PART
            _remove_oldest(self._folder / RING, "*.mcap", self._minutes + 1)  # the newest is not full
        if self._stop and (now >= self._stop_ends or self._stop.size >= LARGEST):
            self._stop.close()
            self._stop = None

    def _begin(self, folder: Path, now: int, messages: Iterable[Message], prefix: str = "") -> Recorder:
        seconds, rest = divmod(now + self._offset, 10**9)
        name = time.strftime(f"{prefix}%Y%m%d-%H%M%S.{rest // 10**6:03}.mcap", time.localtime(seconds))
        recorder = Recorder(folder / name, now, now + self._offset)
        for message in messages:
            recorder.message(*message)
        return recorder

    def _remember(self, message: Message) -> None:
        self._recent.append(message)
        self._recent_cost += message.cost
        while self._recent_cost > LARGEST or self._recent[0].received < message.received - BEFORE:
            oldest = self._recent.popleft()
            self._recent_cost -= oldest.cost
            if oldest.topic in self._latched:
                self._before[oldest.topic] = oldest


def _remove_oldest(folder: Path, pattern: str, most: int) -> None:
    """Remove the oldest records of a folder until `most` are left. Earlier runs count as well."""
    paths = sorted(folder.glob(pattern), key=lambda path: path.stat().st_mtime)
    for path in paths[: max(0, len(paths) - most)]:
        path.unlink(missing_ok=True)
