"""What every alternative offers to the processes of the benchmark."""

from __future__ import annotations

from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias

Item: TypeAlias = "array[int]"
"""Octets; the first eight are the time of sending."""

SOURCE, MIDDLE, SINK = "source", "middle", "sink"
KINEMATICS, VELOCITY = "kinematics", "velocity"
"""The middle processes of the arm's own chain, from an angle to a speed."""
WATCHDOG = "watchdog"
"""The process that listens to HEARTBEATS."""
FIRST, LAST = "first", "last"
"""The topics: the middle process listens to the first one, the sink to the last one."""
HEARTBEATS = "operator_heartbeat"
"""The topic of the dead man's switch."""
REPORTS = "reports"
"""The name of the socket in the directory of a measurement."""


@dataclass(frozen=True)
class Job:
    link: str
    """The module of :mod:`tests.benchmarks.links`."""
    role: str
    topic: str
    """Where the source publishes."""
    size: int
    """The size of an item [octets]."""
    rate: float
    """The rate of the source [Hz]; 0: as fast as it can."""
    warm_up: float
    """From the first item until the measurement [s]."""
    seconds: float
    """The time of the measurement."""
    directory: str
    """For sockets, and for names that no other measurement has."""

    @property
    def depth(self) -> int:
        return 1000 if self.size <= 1000 else 10


class Link(ABC):
    """The connection of one process with the others."""

    def __init__(self, job: Job) -> None:
        self.job = job

    @abstractmethod
    def publisher(self, topic: str) -> Callable[[Item], object]:
        """Return a function that publishes an item."""

    @abstractmethod
    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        """Call back with each item: a sequence of octets, of a type that the alternative chooses."""

    def forward(self, source: str, target: str) -> None:
        """Publish each item of one topic on another: the recipe of the middle process."""
        publish = self.publisher(target)
        self.subscribe(source, publish)

    @abstractmethod
    def wait(self, seconds: float) -> None:
        """Call back with what arrives, until something has arrived, at most for about `seconds`."""

    def sent(self) -> int:
        """Return how many items the source has sent by now; 0 if this process cannot know."""
        return 0

    def close(self) -> None:  # noqa: B027, most have nothing to release
        """Release what would outlive this process."""
