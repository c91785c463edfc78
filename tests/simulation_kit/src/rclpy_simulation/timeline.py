"""What has happened in a simulation, as lines: starts, faults, ends, output and messages."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

from rclpy_simulation.simulation import Simulation

_KEPT = 60  # lines


class _Stream(NamedTuple):
    begin: float
    end: float
    count: int


class Timeline:
    """The last events of a simulation. Messages of a topic between two other events are one line."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._lines: deque[str] = deque(maxlen=_KEPT)
        self._streams: dict[tuple[str, str], _Stream] = {}
        simulation.tap(self._message)
        simulation.notes.append(self._note)

    def _message(self, writer: Any, sample: Any) -> None:
        if writer.topic.startswith("rt/") and writer.topic not in ("rt/rosout", "rt/parameter_events"):
            key, now = (writer.participant.process.name, writer.topic[2:]), self._simulation.now
            begin, _, count = self._streams.get(key, (now, now, 0))
            self._streams[key] = _Stream(begin, now, count + 1)

    def _note(self, text: str) -> None:
        self._end_streams()
        self._lines.append(f"{self._simulation.now:12.3f}            {text}")

    def _end_streams(self) -> None:
        for (name, topic), (begin, end, count) in sorted(self._streams.items(), key=lambda each: each[1]):
            until = f" – {end:9.3f}" if count > 1 else " " * 12
            self._lines.append(f"{begin:12.3f}{until}    {name} sends {topic}" + f" × {count}" * (count > 1))
        self._streams.clear()

    @property
    def text(self) -> str:
        self._end_streams()
        return "\n".join(self._lines)
