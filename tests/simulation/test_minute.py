"""A minute of chaos in virtual time, with 21 faults of all kinds: `make test` runs it."""

from __future__ import annotations

from tests.promises.findings import HOLDS
from tests.simulation import plan
from tests.simulation.faults import FAULT_KINDS
from tests.simulation.outcome import simulate


def test_no_promise_is_violated_in_a_minute_of_chaos() -> None:
    outcome = simulate(plan.experiment("one", 60.0, 2.5, [*FAULT_KINDS]))
    assert [each for finding in outcome.findings for each in finding.evidence] == []
    verdicts = {finding.promise: finding.verdict for finding in outcome.findings}
    assert {promise for promise in verdicts if verdicts[promise] != HOLDS} <= {"S2"}
    assert sum(outcome.injected.values()) > 10
