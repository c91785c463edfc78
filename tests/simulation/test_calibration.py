"""The durations of the simulation come from a real arm, and the simulated run agrees with the real one."""

from __future__ import annotations

import pytest

from tests.chaos import schedule
from tests.chaos.schedule_file import Experiment
from tests.chaos.testbed import SCENARIO
from tests.promises.findings import percentile
from tests.promises.history import History, Life, Sample
from tests.simulation.arm import NAMES
from tests.simulation.calibration import latencies, load
from tests.simulation.outcome import simulate

S1_BOUND = 0.6  # s: a silence is sampled every 500 ms, from a moment that differs
L1_BOUNDS = (0.1, 0.3)  # s, of median and 99th percentile: the longest of some 36 restarts varies


def test_latency_is_that_of_messages_that_waited_for_nothing() -> None:
    streams = {
        "theta1": [Sample(5.5, 5.9, 1.0), Sample(20.0, 20.001, 1.0)],  # of a new process, and of a known one
        "operator_heartbeat": [Sample(20.0, 20.05, True)],
    }
    history = History(60.0, streams, [Life("config_theta1", 7, 5.0, None)])
    assert latencies(history) == pytest.approx([0.001])


def test_the_simulated_play_agrees_with_the_real_one() -> None:
    planned = schedule.briefly()
    faults = [each for each in planned if each.target in NAMES]
    outcome = simulate(Experiment("briefly", schedule.duration(planned), SCENARIO, faults))
    assert not outcome.violated()
    findings = {finding.promise: finding for finding in outcome.findings}
    discovery, real = load().discovery, load().measured
    assert findings["S1"].worst == pytest.approx(real["S1"], abs=S1_BOUND)
    silences = [time for times in findings["L1"].times.values() for time in times]
    # The simulation notes what is sent; the recorder of a real arm has to discover a new process first.
    heard = [max(silence, discovery.median) for silence in silences]
    for percent, measured, bound in zip((50, 99), real["L1"], L1_BOUNDS, strict=True):
        assert percentile(heard, percent) == pytest.approx(measured, abs=bound)
