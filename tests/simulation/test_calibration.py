"""The durations of the simulation come from a real arm, and the simulated run agrees with the real one."""

from __future__ import annotations

import pytest

from tests.chaos import schedule
from tests.chaos.schedule_file import Experiment
from tests.chaos.testbed import SCENARIO
from tests.promises.findings import percentile
from tests.simulation.arm import NAMES
from tests.simulation.calibration import load
from tests.simulation.outcome import simulate

S1_BOUND = 0.6  # s: a silence is sampled every 500 ms, from a moment that differs
L1_BOUNDS = (0.1, 0.3)  # s, of median and 99th percentile: the longest of some 36 restarts varies


def test_the_simulated_play_agrees_with_the_real_one() -> None:
    planned = schedule.briefly()
    faults = [each for each in planned if each.target in NAMES]
    outcome = simulate(Experiment("briefly", schedule.duration(planned), SCENARIO, faults))
    assert not outcome.violated()
    findings = {finding.promise: finding for finding in outcome.findings}
    real = load().measured
    assert findings["S1"].worst == pytest.approx(real["S1"], abs=S1_BOUND)
    silences = [time for times in findings["L1"].times.values() for time in times]
    for percent, measured, bound in zip((50, 99), real["L1"], L1_BOUNDS, strict=True):
        assert percentile(silences, percent) == pytest.approx(measured, abs=bound)
