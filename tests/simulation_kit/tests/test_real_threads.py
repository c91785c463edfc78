"""A real thread outside of a simulation is in no simulated process, whichever runs at that moment."""

from __future__ import annotations

import _thread
import threading
import time

import pytest

from rclpy_simulation import Simulation


@pytest.mark.simulation(seed=7)
def test_a_real_thread_keeps_its_identity_and_its_time(simulation: Simulation) -> None:
    asked, answered = _thread.allocate_lock(), _thread.allocate_lock()
    asked.acquire()
    answered.acquire()
    seen: list[object] = []

    def answer() -> None:
        asked.acquire()
        begin = time.monotonic()
        waited = threading.Event().wait(0.05)
        seen.extend([threading.get_ident() == _thread.get_ident(), waited, time.monotonic() - begin >= 0.05])
        answered.release()

    _thread.start_new_thread(answer, ())

    def ask() -> None:
        asked.release()
        answered.acquire()  # a real wait, in which the simulated process stays the current one

    simulation.start(ask)
    simulation.run(1.0)
    assert seen == [True, False, True]
