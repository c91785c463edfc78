from __future__ import annotations

from interfaces.topics import TURN_OFF
from reactive_node.testing import VirtualTime
from services.examples.speed_guard import too_fast


def test_engines_turn_off_when_a_speed_is_too_fast(scheduler: VirtualTime) -> None:
    speeds = scheduler.hot((1, 1.9), (2, 2.0), (3, 2.1), (4, 2.2), (5, 1.0), (6, 2.5))
    recording = scheduler.record(too_fast(speeds, 2.0), until=10)
    assert recording.items == [(3, TURN_OFF), (6, TURN_OFF)]
