"""The arm's own chain in plain callbacks: θ1 → kinematics → velocity → speed, as a ROS 2 program has it.

Its watchdog hears each heartbeat and reports the operator twice a second, as the thesis throttles them.
"""

from __future__ import annotations

import math
import mmap
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from geometry_msgs.msg import PointStamped
from std_msgs.msg import Bool, Float64, Header

from interfaces.topics import (
    EFFECTOR_POSITION,
    EFFECTOR_SPEED,
    L1,
    L2,
    OPERATOR_HEARTBEAT,
    OPERATOR_PRESENCE,
    THETA1,
    THETA2,
    Topic,
)
from tests.benchmarks.link import KINEMATICS, VELOCITY, Item, Job
from tests.benchmarks.links import callbacks


class Connection(callbacks.Connection):
    """A node of the chain. The source leaves time and number in shared memory: a speed has neither."""

    def __init__(self, job: Job) -> None:
        super().__init__(job)
        file = os.open(Path(job.directory, "sent"), os.O_RDWR | os.O_CREAT, 0o600)
        os.ftruncate(file, 16)
        self.memory = mmap.mmap(file, 16)  # the time of the latest item, and how many there were
        os.close(file)

    def publisher(self, topic: str) -> Callable[[Item], object]:
        """Return a function that publishes the next angle, which differs from the one before."""
        for fixed in (L1, L2, THETA2):
            self._publisher(fixed)(Float64(data=1.0))
        publish = self._publisher(THETA1)
        count = 0

        def turn(item: Item) -> None:
            nonlocal count
            count += 1
            self.memory[:] = item.tobytes() + count.to_bytes(8, "little")
            publish(Float64(data=count % 1000 / 1000))

        return turn

    def subscribe(self, topic: str, on_item: Callable[[Any], object]) -> None:
        """Call back with the latest time of sending when a speed arrives."""
        self._listen(EFFECTOR_SPEED, lambda _: on_item(self.memory))

    def sent(self) -> int:
        return int.from_bytes(self.memory[8:], "little")

    def forward(self, source: str, target: str) -> None:
        if self.job.role == KINEMATICS:
            self._kinematics()
        elif self.job.role == VELOCITY:
            self._velocity()
        else:
            self._watchdog()

    def _kinematics(self) -> None:
        publish = self._publisher(EFFECTOR_POSITION)
        known: dict[str, float] = {}

        def remember(topic: Topic) -> None:
            def on_message(message: Float64) -> None:
                known[topic.name] = message.data
                if len(known) == 4:
                    move()

            self._listen(topic, on_message)

        def move() -> None:
            heading = known["theta1"] + known["theta2"]
            position = PointStamped()
            position.header.stamp = self.node.get_clock().now().to_msg()
            position.header.frame_id = "base"
            position.point.x = known["l1"] * math.cos(known["theta1"]) + known["l2"] * math.cos(heading)
            position.point.y = known["l1"] * math.sin(known["theta1"]) + known["l2"] * math.sin(heading)
            publish(position)

        for topic in (L1, L2, THETA1, THETA2):
            remember(topic)

    def _velocity(self) -> None:
        publish = self._publisher(EFFECTOR_SPEED)
        before: PointStamped | None = None

        def on_message(message: PointStamped) -> None:
            nonlocal before
            if before is not None:
                then, now = before.header.stamp, message.header.stamp
                seconds = now.sec - then.sec + (now.nanosec - then.nanosec) / 1e9
                if seconds > 0:
                    x, y = message.point.x - before.point.x, message.point.y - before.point.y
                    publish(Float64(data=math.hypot(x, y) / seconds))
            before = message

        self._listen(EFFECTOR_POSITION, on_message)

    def _watchdog(self) -> None:
        publish = self._publisher(OPERATOR_PRESENCE)
        is_alive = False

        def on_heartbeat(_: Bool) -> None:
            nonlocal is_alive
            is_alive = True

        def report() -> None:
            nonlocal is_alive
            if is_alive:
                publish(Header(stamp=self.node.get_clock().now().to_msg()))
            is_alive = False

        self._listen(OPERATOR_HEARTBEAT, on_heartbeat)
        self.node.create_timer(0.5, report)

    def _publisher(self, topic: Topic) -> Callable[[Any], object]:
        return self.node.create_publisher(topic.type, topic.name, topic.qos).publish

    def _listen(self, topic: Topic, callback: Callable[..., Any]) -> None:
        self.node.create_subscription(topic.type, topic.name, callback, topic.qos)
