"""The arm's own chain in Python without rclpy: DDS through ctypes, messages by `struct`.

It checks nothing and knows no type: what a Python program on Cyclone DDS cannot undercut by much.
"""

from __future__ import annotations

import ctypes as ct
import math
import struct
import time
from collections.abc import Callable

from rclpy._dds import WaitSet
from rclpy._dds.library import (
    ANY_STATE,
    BYTES_HEADER,
    SERDATA_KIND_DATA,
    SampleInfo,
    Serdata,
    blocking,
    pack_vector,
    quick,
)

from deploy.benchmarks.link import Job
from deploy.benchmarks.links import chain
from interfaces.topics import EFFECTOR_POSITION, EFFECTOR_SPEED, L1, L2, THETA1, THETA2, Topic

_HEADER = b"\0\1\0\0"  # CDR, little endian
_NUMBER = struct.Struct("<4sd")
_POSITION = struct.Struct("<4siII12sddd")  # stamp, length of the frame's name, the name and padding, x, y, z


class Connection(chain.Connection):
    """Readers and writers of a node that does not spin."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        self._readers: list[tuple[int, Callable[[bytes], None]]] = []
        self._wait_set = WaitSet()
        self._serdata, self._info = Serdata(), SampleInfo()

    def _kinematics(self) -> None:
        write = self._writer(EFFECTOR_POSITION)
        known: dict[str, float] = {}

        def remember(topic: Topic) -> None:
            def on_data(data: bytes) -> None:
                known[topic.name] = _NUMBER.unpack(data)[1]
                if len(known) == 4:
                    move()

            self._read(topic, on_data)

        def move() -> None:
            heading = known["theta1"] + known["theta2"]
            x = known["l1"] * math.cos(known["theta1"]) + known["l2"] * math.cos(heading)
            y = known["l1"] * math.sin(known["theta1"]) + known["l2"] * math.sin(heading)
            seconds, nanoseconds = divmod(time.time_ns(), 10**9)
            write(_POSITION.pack(_HEADER, seconds, nanoseconds, 5, b"base", x, y, 0.0))

        for topic in (L1, L2, THETA1, THETA2):
            remember(topic)

    def _velocity(self) -> None:
        write = self._writer(EFFECTOR_SPEED)
        before: tuple[float, float, float] | None = None

        def on_data(data: bytes) -> None:
            nonlocal before
            _, seconds, nanoseconds, _, _, x, y, _ = _POSITION.unpack(data)
            now = seconds + nanoseconds / 1e9
            if before is not None and now > before[0]:
                speed = math.hypot(x - before[1], y - before[2]) / (now - before[0])
                write(_NUMBER.pack(_HEADER, speed))
            before = now, x, y

        self._read(EFFECTOR_POSITION, on_data)

    def _read(self, topic: Topic, on_data: Callable[[bytes], None]) -> None:
        reader = self.node.create_subscription(topic.type, topic.name, lambda _: None, topic.qos).handle
        self._wait_set.attach(reader.condition, len(self._readers))
        self._readers.append((reader.handle, on_data))

    def _writer(self, topic: Topic) -> Callable[[bytes], None]:
        writer = self.node.create_publisher(topic.type, topic.name, topic.qos).handle
        handle, sertype = writer.handle, writer._sertype

        def write(data: bytes) -> None:
            size = len(data)
            vector = pack_vector(id(data) + BYTES_HEADER, size)
            serdata = quick.ddsi_serdata_from_ser_iov(sertype, SERDATA_KIND_DATA, 1, vector, size)
            blocking.dds_writecdr(handle, serdata)

        return write

    def wait(self, seconds: float) -> None:
        if not self._readers:  # source, sink and watchdog are those of the chain in callbacks
            super().wait(seconds)
            return
        end = time.monotonic_ns() + int(seconds * 1e9)
        while (left := end - time.monotonic_ns()) > 0:
            for token in self._wait_set.wait(left):
                self._take(*self._readers[token])

    def _take(self, reader: int, on_data: Callable[[bytes], None]) -> None:
        serdata, info = self._serdata, self._info
        while quick.dds_takecdr(reader, ct.byref(serdata), 1, ct.byref(info), ANY_STATE) > 0:
            data = bytes(quick.ddsi_serdata_size(serdata))
            quick.ddsi_serdata_to_ser(serdata, 0, len(data), data)
            quick.ddsi_serdata_unref(serdata)
            if info.valid_data:
                on_data(data)
