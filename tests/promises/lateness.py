"""When messages were late because the machine was overloaded: what a reader adds to a record."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from interfaces import topics
from tests.promises.history import BAD_LINE, LOSS, PARTITION, History, Sample, merged

LATE = 0.1  # s; a message that takes longer shows an overload
REDISCOVERY = 10.0  # s after a partition until the hosts have discovered each other again
MATCHED = 2.0  # s from the start of a process until every reader knows its publishers

Interval = tuple[float, float]


def overloads(history: History) -> list[Interval]:
    """Return the times in which a message waited for the observer, or for its sender.

    Messages that a fault of the network may have delayed do not count, nor those of a publisher that the
    observer may not have discovered yet.
    """
    slow_lines = [*_slow_lines(history)]
    return merged(
        (sample.sent, sample.received)
        for sample in from_known_publishers(history)
        if sample.received - sample.sent > LATE
        and not any(begin < sample.received and sample.sent < end for begin, end in slow_lines)
    )


def from_known_publishers(history: History) -> Iterator[Sample]:
    """Yield the messages of publishers that every reader knew: others are received after the discovery."""
    starts: dict[str, list[float]] = {}
    for life in history.lives:
        starts.setdefault(life.program, []).append(life.began)
    for topic in topics.CONTRACT:
        for sample in history.stream(topic):
            if not any(
                began < sample.sent < began + MATCHED
                for program in _publishers(topic, sample)
                for began in starts.get(program, ())
            ):
                yield sample


def _slow_lines(history: History) -> Iterable[Interval]:
    for fault in history.faults:
        if fault.kind in (PARTITION, BAD_LINE):
            yield fault.begin, fault.end + REDISCOVERY
    for kind, begin, end in history.conditions:
        if kind == LOSS and end > history.end:  # it was planned: DDS sends again what was lost
            yield begin, end


def _publishers(topic: topics.Topic, sample: Sample) -> Iterable[str]:
    return topic.publishers if topic is not topics.DIAGNOSTICS else sample.value[:1]
