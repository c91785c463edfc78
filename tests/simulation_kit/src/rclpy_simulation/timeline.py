"""What has happened in a simulation, as lines: starts, faults, ends, output and messages."""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple

from rclpy_simulation.simulation import Simulation

_KEPT = 60  # lines
_VERBS = {"rt": "sends", "rq": "calls", "rr": "answers"}
"""By the prefix that ROS 2 gives the DDS topics of its topics, requests and responses."""


class _Stream(NamedTuple):
    begin: float
    end: float
    count: int
    last: str


class Timeline:
    """The last events of a simulation. Messages of a topic, and output, between two others are one line."""

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self._lines: deque[str] = deque(maxlen=_KEPT)
        self._streams: dict[str, _Stream] = {}
        simulation.tap(self._message)
        simulation.notes.append(self._note)

    def _message(self, writer: Any, sample: Any) -> None:
        prefix, _, name = writer.topic.partition("/")
        if prefix in _VERBS and name not in ("rosout", "parameter_events"):
            self._continue(f"{writer.participant.process.name} {_VERBS[prefix]} /{_service(prefix, name)}")

    def _note(self, text: str, output: str) -> None:
        if output:
            self._continue(text, output)
        else:
            self._end_streams()
            self._lines.append(f"{self._simulation.now:12.3f}            {text}")

    def _continue(self, what: str, last: str = "") -> None:
        now = self._simulation.now
        begin, _, count, _ = self._streams.get(what, (now, now, 0, ""))
        self._streams[what] = _Stream(begin, now, count + 1, last)

    def _end_streams(self) -> None:
        for what, (begin, end, count, last) in sorted(self._streams.items(), key=lambda each: each[1]):
            until = f" – {end:9.3f}" if count > 1 else " " * 12
            times = f" × {count}" * (count > 1) + f": {last}" * bool(last)
            self._lines.append(f"{begin:12.3f}{until}    {what}{times}")
        self._streams.clear()

    @property
    def text(self) -> str:
        self._end_streams()
        return "\n".join(self._lines)


def _service(prefix: str, name: str) -> str:
    """Return the name of a topic or service, without what DDS needs."""
    return name if prefix == "rt" else name.removesuffix("Request").removesuffix("Reply")
