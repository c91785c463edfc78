from __future__ import annotations

import threading

from rclpy._dds import INFINITY, GuardCondition, WaitSet


def test_a_wait_set_may_grow_during_a_wait() -> None:
    guards = [GuardCondition() for _ in range(50)]
    waitset = WaitSet()
    waitset.attach(guards[0].handle, 7)
    triggered: list[int] = []
    waiting = threading.Thread(target=lambda: triggered.extend(waitset.wait(INFINITY)))
    waiting.start()
    for token, guard in enumerate(guards[1:], 100):
        waitset.attach(guard.handle, token)
    guards[0].trigger()
    waiting.join(10)
    waitset.close()
    for guard in guards:
        guard.close()
    assert triggered == [7]
