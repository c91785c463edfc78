"""What happened, as seen from outside: the messages of each topic, the lives of processes, and the faults.

Times are seconds since the record began, by the monotonic clock of the host.
"""

from __future__ import annotations

import itertools
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from interfaces import topics

SENTINEL = "sentinel"
OPERATOR, ALL, NOTHING = "operator", "all", "nothing"
"""What a fault may be done to besides a program; `nothing` is what must not be able to disturb anything."""

OVERLOAD, LOSS, SILENCE = "overload", "loss", "silence"
CIRCUMSTANCES = (OVERLOAD, LOSS, SILENCE)
"""Told like faults, but of no process: a machine or network that loses messages; an operator asleep."""

BLINDING = ("stop", "hang", "hog")
"""Faults that keep a process from hearing, until it goes on or is replaced."""


class Sample(NamedTuple):
    """A message as the observer got it."""

    sent: float
    """when its publisher wrote it (DDS source time)"""
    received: float
    value: Any
    """its content, plain: a float, a bool, a string; (x, y) of a position, (node, pid) of a health report"""


class Life(NamedTuple):
    """A process of the system."""

    program: str
    """the supervised program; '' for supervisord"""
    pid: int
    began: float
    ended: float | None
    """None while it lives on"""


class Fault(NamedTuple):
    """What the monkey did, and what it hit."""

    kind: str
    target: str
    """the program, or what else it was done to"""
    begin: float
    end: float
    """when the monkey stopped doing it; `begin` for what takes no time"""
    pid: int = 0
    detail: str = ""

    def overlaps(self, begin: float, end: float) -> bool:
        """Whether any of it was between two times."""
        return self.begin < end and self.end > begin


@dataclass(frozen=True)
class History:
    """Everything that one arm did while the record ran."""

    end: float
    streams: dict[str, list[Sample]] = field(default_factory=dict)
    """by relative topic name, in the order of sending"""
    lives: list[Life] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)

    def stream(self, topic: topics.Topic) -> list[Sample]:
        """The messages of a topic."""
        return self.streams.get(topic.name, [])

    def output(self, program: str) -> list[Sample]:
        """The messages by which one sees that a program works."""
        if topic := OUTPUTS.get(program):
            return self.stream(topic)
        return [s for s in self.stream(topics.DIAGNOSTICS) if s.value[0] == program]

    def lives_of(self, program: str) -> list[Life]:
        """The processes of a program, but none that ended beside an older one: that was a double."""
        lives = [life for life in self.lives if life.program == program]
        return [life for life in lives if not any(_outlives(older, life) for older in lives)]

    def ended(self, fault: Fault) -> float:
        """When a fault was over: when the monkey stopped doing it, or its victim was replaced before."""
        if fault.kind not in BLINDING:
            return fault.end
        victim = (fault.target, fault.pid)
        ends = [life.ended for life in self.lives if (life.program, life.pid) == victim and life.ended]
        return min([fault.end, *ends])

    def may_have_missed(self, begin: float, end: float) -> bool:
        """Whether the observer may not know all that was said between two times."""
        return any(True for _ in self._blind(begin, end))

    def missed(self, begin: float, end: float) -> float:
        """How much of the time [s] between two times the observer may not know all that was said."""
        return sum(min(end, f.end) - max(begin, f.begin) for f in self._blind(begin, end))

    def _blind(self, begin: float, end: float) -> Iterator[Fault]:
        return (f for f in self.faults if f.kind in (OVERLOAD, LOSS) and f.overlaps(begin, end))


OUTPUTS = {
    publisher: topic
    for topic in topics.CONTRACT
    if topic not in (topics.ENGINES, topics.OPERATOR_ACTIVITY, topics.DIAGNOSTICS)
    for publisher in topic.publishers
}
"""The topic by which one sees that a service works; the sentinel's is its health."""

PROGRAMS = (*OUTPUTS, SENTINEL)


def suffix(namespace: str) -> str:
    """What the name of an arm's file ends with: nothing in the root namespace, `_arm1` in `/arm1`."""
    return namespace.replace("/", "_").rstrip("_")


def between(samples: Sequence[Sample], begin: float, end: float) -> Sequence[Sample]:
    """The samples sent from `begin` up to and including `end`."""
    return samples[
        bisect_left(samples, begin, key=lambda s: s.sent) : bisect_right(samples, end, key=lambda s: s.sent)
    ]


def gaps(times: Iterable[float], begin: float, end: float) -> Iterable[tuple[float, float]]:
    """The stretches into which the sorted `times` cut that from `begin` to `end`."""
    last = begin
    for time in itertools.chain(times, [end]):
        if last < min(time, end):
            yield last, min(time, end)
            last = time


def _outlives(one: Life, two: Life) -> bool:
    """Whether a process was there before another one, and longer."""
    later = one.ended is None or (two.ended is not None and one.ended > two.ended)
    return one.began < two.began and later
