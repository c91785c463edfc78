"""The time of day of an arm's processes steps; that of the machine and monotonic time do not."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from tests.chaos import clock
from tests.chaos.clock import LARGEST, Clock
from tests.chaos.faults import INJECTED
from tests.promises.observations import time_sent

needs_library = pytest.mark.skipif(bool(clock.missing()), reason=f"platform: {clock.missing()}")


def test_steps_add_up_and_are_the_same_in_each_run(tmp_path: Path) -> None:
    clocks = [Clock(tmp_path / name) for name in "ab"]
    before = 0.0
    for _ in range(20):
        for each in clocks:
            each.step()
        assert clocks[0].ahead == clocks[1].ahead == float((tmp_path / "a").read_text())
        assert 0.0 < abs(clocks[0].ahead - before) <= LARGEST
        before = clocks[0].ahead


@pytest.mark.parametrize("latency", [0.0001, 0.4, 15.0])
@pytest.mark.parametrize("ahead", [0.0, -2632.577, 131.054])
def test_source_time_of_a_stepped_process_is_put_right(latency: float, ahead: float) -> None:
    stamp = 100.0 - latency + ahead
    assert time_sent(100.0, stamp, [0.0, -2632.577, 131.054]) == pytest.approx(100.0 - latency)


def test_no_message_is_received_before_it_is_sent() -> None:
    assert time_sent(100.0, 100.1, [0.0, 0.3]) == pytest.approx(99.8)


@pytest.mark.parametrize("early", [1e-6, 1e-4])
def test_message_that_seems_a_little_early_is_not_of_another_time_of_day(early: float) -> None:
    assert time_sent(100.0, 100.0 + early, [0.0, 1800.0]) == pytest.approx(100.0 + early)
    sent = time_sent(100 * 10**9, 100 * 10**9 + round(early * 1e9), [0, 1800 * 10**9], second=10**9)
    assert sent == 100 * 10**9 + round(early * 1e9)


@pytest.mark.parametrize("stamp", [99.9, 100.1])
def test_source_time_without_a_step_stays_as_it_is(stamp: float) -> None:
    assert time_sent(100.0, stamp, [0.0]) == stamp


PROGRAM = """
import os, time

print(os.environ["FAKETIME_SHARED"], flush=True)
shown = 0.0
while True:
    difference = time.time() - time.monotonic()
    if abs(difference - shown) > 1.0:
        print(difference, flush=True)
        shown = difference
    time.sleep(0.01)
"""
"""Prints by how much its time of day differs from its monotonic time, again after each step."""


@pytest.fixture
def environment(tmp_path: Path) -> Iterator[dict[str, str]]:
    """The environment of a process whose time of day can be stepped."""
    with clock.faked() as faked:
        paths = os.pathsep.join([str(INJECTED), os.environ.get("PYTHONPATH", "")])
        yield {**os.environ, **faked, **Clock(tmp_path / "clock").environment(), "PYTHONPATH": paths}
    names = faked["FAKETIME_SHARED"].split()
    assert len(names) == 2
    left = {path.name for path in Path("/dev/shm").iterdir()}
    assert not left & {name.strip("/") for name in (*names, f"sem.{names[0].strip('/')}")}


@contextmanager
def running(environment: dict[str, str]) -> Iterator[IO[str]]:
    """Run :data:`PROGRAM`, until it is killed; give what it prints."""
    command = [sys.executable, "-c", PROGRAM]
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            # It has made no semaphore of its own, which would survive SIGKILL.
            assert process.stdout.readline().strip() == environment["FAKETIME_SHARED"]
            yield process.stdout
        finally:
            process.kill()


@needs_library
def test_process_and_its_successor_are_stepped(environment: dict[str, str], tmp_path: Path) -> None:
    time_of_day = Clock(tmp_path / "clock")
    with running(environment) as printed:
        before = float(printed.readline())
        for _ in range(2):
            time_of_day.step()
            begin = time.monotonic()
            assert float(printed.readline()) - before == pytest.approx(time_of_day.ahead, abs=1.0)
            assert time.monotonic() - begin < 5.0
    with running(environment) as printed:
        assert float(printed.readline()) - before == pytest.approx(time_of_day.ahead, abs=1.0)
