"""The wiring of the speed guard. The file of its recipe is the template of `make new-service`."""

from __future__ import annotations

import pytest
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from std_msgs.msg import String

from interfaces.topics import EFFECTOR_TWIST, ENGINES, ENGINES_STATE, ON, TURN_OFF
from reactive_node.testing import SpinUntil
from services.examples import speed_guard
from tests.component.wiring import Connect


@pytest.mark.parametrize(
    ("x", "y", "parameters"),
    [(2.5, 0.0, {}), (0.0, -2.5, {}), (1.5, 1.5, {}), (1.5, 0.0, {"limit": 1.0})],
)
def test_speed_is_that_of_both_axes(
    connect: Connect, spin_until: SpinUntil, x: float, y: float, parameters: dict[str, float]
) -> None:
    inputs, outputs = [EFFECTOR_TWIST, ENGINES_STATE], [ENGINES]
    wired = connect(speed_guard.wire, inputs=inputs, outputs=outputs, **parameters)

    def is_off() -> bool:
        wired.publish(EFFECTOR_TWIST, TwistStamped(twist=Twist(linear=Vector3(x=x, y=y))))
        wired.publish(ENGINES_STATE, String(data=ON))
        return bool(wired.heard[ENGINES.name])

    spin_until(is_off)
    assert {it.data for it in wired.heard[ENGINES.name]} == {TURN_OFF}
