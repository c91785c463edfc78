"""The observer of a simulated arm: it sees each message at the moment it is sent, and makes the history."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from typing import Any

from rclpy_simulation import Simulation

from interfaces import topics
from tests.promises.history import Condition, History, InjectedFault, Life, Sample
from tests.promises.marks import is_babble
from tests.promises.observations import values

RECEPTION = 0.0005  # s after sending
_UNREAD = {topic.name for topic in (topics.JOINT_STATES, topics.TF, topics.ROBOT_DESCRIPTION)}
"""The checkers read only the times of these topics; decoding them would be slow."""


class Observer:
    """Records the messages of an arm in the root namespace."""

    def __init__(self, simulation: Simulation, origin: float) -> None:
        """:param origin: from which the times of the history count [s of the simulation]."""
        self._simulation = simulation
        self._origin = origin
        self._topics = {f"rt{topic.full_name('/')}": topic for topic in topics.CONTRACT}
        self._streams: dict[str, list[Sample]] = {topic.name: [] for topic in topics.CONTRACT}
        self._digest = hashlib.sha256()
        self.messages = 0
        simulation.tap(self._note)

    def _note(self, writer: Any, sample: Any) -> None:
        topic = self._topics.get(writer.topic)
        if topic is None:
            return
        self.messages += 1
        sent = self._simulation.now - self._origin
        self._digest.update(b"%.9f %s " % (sent, topic.name.encode()))
        self._digest.update(sample.data)
        stream = self._streams[topic.name]
        if topic.name in _UNREAD:
            if not is_babble(topic, sample.data):
                stream.append(Sample(sent, sent + RECEPTION, None))
            return
        stream += [Sample(sent, sent + RECEPTION, value) for value in values(topic, sample.data, "/")]

    @property
    def digest(self) -> str:
        """A hash of all messages with their times: equal for equal runs."""
        return self._digest.hexdigest()

    def history(
        self,
        lives: Sequence[Life],
        faults: Sequence[InjectedFault],
        conditions: Sequence[Condition],
        end: float,
        programs: Sequence[str],
    ) -> History:
        """Return what happened until ``end`` [s] to an arm that has these programs."""
        origin = self._origin
        moved = [
            life._replace(
                began=life.began - origin, ended=None if life.ended is None else life.ended - origin
            )
            for life in lives
        ]
        return History(
            end, self._streams, moved, sorted(faults, key=lambda f: f.begin), [*conditions], programs
        )
