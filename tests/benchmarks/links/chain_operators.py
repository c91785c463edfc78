"""The arm's own chain with the operators of its recipes on plain callbacks: what RxPY itself costs."""

from __future__ import annotations

from typing import Any

from reactivex import Observable
from reactivex.subject import Subject

from interfaces.topics import EFFECTOR_POSITION, EFFECTOR_SPEED, L1, L2, THETA1, THETA2, Position, Topic
from services.kinematics import effector_position
from services.velocity import effector_speed
from tests.benchmarks.links import chain


class Connection(chain.Connection):
    """A recipe between a subject for each subscription and a publisher, without a ReactiveNode."""

    def _kinematics(self) -> None:
        publish, clock = self._publisher(EFFECTOR_POSITION), self.node.get_clock()

        def move(position: tuple[float, float]) -> None:
            publish(EFFECTOR_POSITION.message(Position(clock.now().nanoseconds, *position)))

        l1, l2, theta1, theta2 = map(self._values, (L1, L2, THETA1, THETA2))
        effector_position(l1, l2, theta1, theta2).subscribe(move)

    def _velocity(self) -> None:
        publish = self._publisher(EFFECTOR_SPEED)

        def report(speed: Any) -> None:
            publish(EFFECTOR_SPEED.message(speed))

        effector_speed(self._values(EFFECTOR_POSITION)).subscribe(report)

    def _values(self, topic: Topic) -> Observable[Any]:
        messages: Subject[Any] = Subject()
        self._listen(topic, messages.on_next)
        return messages.map(topic.value)
