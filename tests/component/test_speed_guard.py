"""The example of a service: engines off when the effector is too fast."""

from __future__ import annotations

from interfaces.topics import TURN_OFF
from reactive_node.testing import VirtualTime
from services.examples.speed_guard import too_fast


def test_engines_turn_off_when_two_speeds_in_a_row_are_too_fast(scheduler: VirtualTime) -> None:
    speeds = scheduler.hot((1, 2.1), (2, 1.9), (3, 2.1), (4, 2.2), (5, 2.3), (6, 1.0), (7, 2.5), (8, 2.5))
    recording = scheduler.record(too_fast(speeds, 2.0), until=10)
    assert recording.items == [(4, TURN_OFF), (8, TURN_OFF)]
