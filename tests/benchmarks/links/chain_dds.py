"""The arm's own chain with its recipes but without rclpy: bare DDS readers and writers, messages by `struct`.

It checks nothing and knows no type: what a Python program with RxPY on Cyclone DDS cannot undercut by much.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable

from rclpy._dds import Reader, WaitSet
from reactivex import Observable
from reactivex.subject import Subject

from interfaces.topics import EFFECTOR_POSITION, EFFECTOR_SPEED, L1, L2, THETA1, THETA2, Position, Topic
from services.kinematics import effector_position
from services.velocity import effector_speed
from tests.benchmarks.link import Job
from tests.benchmarks.links import chain

_HEADER = b"\0\1\0\0"  # CDR, little endian
_NUMBER = struct.Struct("<4sd")
_POSITION = struct.Struct("<4siII12sddd")  # stamp, length of the frame's name, the name and padding, x, y, z


def _number(data: bytes) -> float:
    number: float = _NUMBER.unpack(data)[1]
    return number


def _position(data: bytes) -> Position:
    _, seconds, nanoseconds, _, _, x, y, _ = _POSITION.unpack(data)
    return Position(seconds * 10**9 + nanoseconds, x, y)


class Connection(chain.Connection):
    """The DDS readers and writers of a node that does not spin."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        self._readers: list[tuple[Reader, Callable[[bytes], None]]] = []
        self._wait_set = WaitSet()

    def _kinematics(self) -> None:
        write = self._writer(EFFECTOR_POSITION)

        def move(position: tuple[float, float]) -> None:
            x, y = position
            seconds, nanoseconds = divmod(time.time_ns(), 10**9)
            write(_POSITION.pack(_HEADER, seconds, nanoseconds, 5, b"base", x, y, 0.0))

        l1, l2, theta1, theta2 = (self._data(topic).map(_number) for topic in (L1, L2, THETA1, THETA2))
        effector_position(l1, l2, theta1, theta2).subscribe(move)

    def _velocity(self) -> None:
        write = self._writer(EFFECTOR_SPEED)
        speeds = effector_speed(self._data(EFFECTOR_POSITION).map(_position))
        speeds.subscribe(lambda speed: write(_NUMBER.pack(_HEADER, speed)))

    def _data(self, topic: Topic) -> Observable[bytes]:
        data: Subject[bytes] = Subject()
        reader = self.node.create_subscription(topic.type, topic.name, lambda _: None, topic.qos).handle
        self._wait_set.attach(reader.condition, len(self._readers))
        self._readers.append((reader, data.on_next))
        return data

    def _writer(self, topic: Topic) -> Callable[[bytes], None]:
        return self.node.create_publisher(topic.type, topic.name, topic.qos).handle.write

    def wait(self, seconds: float) -> None:
        if not self._readers:  # source, sink and watchdog are those of the chain in callbacks
            super().wait(seconds)
            return
        end = time.monotonic_ns() + int(seconds * 1e9)
        while (left := end - time.monotonic_ns()) > 0:
            for token in self._wait_set.wait(left):
                reader, on_data = self._readers[token]
                while (sample := reader.take()) is not None:
                    on_data(sample.data)
