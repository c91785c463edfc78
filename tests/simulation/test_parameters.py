"""Any parameters that a start accepts: the judge finds no violation where nothing is planted."""

from __future__ import annotations

import pytest

from tests.simulation.outcome import simulate
from tests.simulation.settings import experiment

LENGTH = 60.0  # s
EXAMPLES = 8


@pytest.mark.parametrize("seed", range(EXAMPLES))
def test_the_promises_hold_with_any_parameters_that_a_start_accepts(seed: int) -> None:
    outcome = simulate(experiment(str(seed), LENGTH))
    assert [each for finding in outcome.findings for each in finding.evidence] == []
