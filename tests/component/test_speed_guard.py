from __future__ import annotations

from interfaces.topics import OFF, ON, TURN_OFF
from reactive_node.testing import VirtualTime
from services.examples.speed_guard import too_fast


def test_engines_turn_off_when_a_speed_is_too_fast(scheduler: VirtualTime) -> None:
    speeds = scheduler.hot((1, 1.9), (2, 2.0), (3, 2.1), (5, 1.0), (6, 2.5))
    engines = scheduler.hot((0, ON), (3.5, OFF), (4, ON), (4.5, OFF), (5.5, ON), (7, OFF))
    recording = scheduler.record(too_fast(speeds, engines, 2.0), until=10)
    assert recording.items == [(3, TURN_OFF), (4, TURN_OFF), (6, TURN_OFF)]
