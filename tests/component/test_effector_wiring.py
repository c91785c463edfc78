from __future__ import annotations

from typing import Any

import pytest
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, PointStamped
from std_msgs.msg import Float64, Header

from interfaces.topics import CONFIGURATION, EFFECTOR_POSITION, EFFECTOR_SPEED, L1, L2, THETA1, THETA2
from reactive_node import stamps
from reactive_node.testing import SpinUntil
from services import kinematics, velocity
from tests.component.wiring import Connect


@pytest.mark.parametrize(("namespace", "frame"), [("", "base"), ("/arm1", "arm1/base")])
def test_position_has_its_frame_and_the_time_of_emission(
    connect: Connect, spin_until: SpinUntil, namespace: str, frame: str
) -> None:
    wired = connect(
        kinematics.wire, inputs=CONFIGURATION.values(), outputs=[EFFECTOR_POSITION], namespace=namespace
    )
    before = stamps.now()
    for topic, value in ((L1, 2.0), (L2, 3.0), (THETA1, 0.0), (THETA2, 0.0)):
        wired.publish(topic, Float64(data=value))
    positions: list[Any] = wired.heard[EFFECTOR_POSITION.name]
    spin_until(lambda: positions)

    (position,) = positions
    assert position.header.frame_id == frame
    assert position.point == Point(x=5.0, y=0.0)
    assert before <= stamps.from_message(position.header.stamp) <= stamps.now()


def test_speed_without_advancing_time_is_dropped_and_counted(
    connect: Connect, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = velocity.effector_speed
    arrived: list[Any] = []
    monkeypatch.setattr(
        velocity, "effector_speed", lambda positions: recipe(positions.do_action(arrived.append))
    )
    wired = connect(velocity.wire, inputs=[EFFECTOR_POSITION], outputs=[EFFECTOR_SPEED])
    for number, (seconds, x) in enumerate(((5, 0.0), (5, 1.0), (7, 7.0)), 1):
        header = Header(stamp=Time(sec=seconds, nanosec=500))
        wired.publish(EFFECTOR_POSITION, PointStamped(header=header, point=Point(x=x)))
        spin_until(lambda number=number: len(arrived) == number)
    spin_until(lambda: wired.heard[EFFECTOR_SPEED.name])

    assert [message.data for message in wired.heard[EFFECTOR_SPEED.name]] == [3.0]
    assert wired.remarks() == ["effector/position: its time stands still"]
    assert wired.reports()[-1]["dropped"] == "1"
