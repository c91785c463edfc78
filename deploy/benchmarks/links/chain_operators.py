"""The arm's own chain with the operators of its recipes on plain callbacks: what RxPY itself costs."""

from __future__ import annotations

from typing import Any

from geometry_msgs.msg import Point, PointStamped
from reactivex import Observable
from reactivex.subject import Subject
from std_msgs.msg import Float64, Header

from deploy.benchmarks.links import chain
from interfaces.topics import EFFECTOR_POSITION, EFFECTOR_SPEED, L1, L2, THETA1, THETA2, Topic
from services.kinematics import effector_position
from services.velocity import _position, effector_speed


class Connection(chain.Connection):
    """A recipe between a subject for each subscription and a publisher, without a ReactiveNode."""

    def _kinematics(self) -> None:
        publish, clock = self._publisher(EFFECTOR_POSITION), self.node.get_clock()

        def move(position: tuple[float, float]) -> None:
            x, y = position
            header = Header(stamp=clock.now().to_msg(), frame_id="base")
            publish(PointStamped(header=header, point=Point(x=x, y=y)))

        inputs = (self._messages(topic).map(lambda m: m.data) for topic in (L1, L2, THETA1, THETA2))
        effector_position(*inputs).subscribe(move)

    def _velocity(self) -> None:
        publish = self._publisher(EFFECTOR_SPEED)

        def report(speed: Any) -> None:
            publish(Float64(data=speed))

        effector_speed(self._messages(EFFECTOR_POSITION).map(_position)).subscribe(report)

    def _messages(self, topic: Topic) -> Observable[Any]:
        messages: Subject[Any] = Subject()
        self._listen(topic, messages.on_next)
        return messages
