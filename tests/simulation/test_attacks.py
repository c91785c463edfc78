"""Attacks on one fail-safe at a time: each holds alone, and no other one hides its bugs."""

from __future__ import annotations

import itertools
import random

import pytest

from deploy.supervision import parameter_file
from interfaces import topics
from tests.chaos.schedule import PlannedFault
from tests.chaos.schedule_file import Experiment
from tests.promises.history import CONTROLLER, FALSE_PRESENCE, HOLD, STUCK_DRIVE, WATCHDOG
from tests.promises.limits import SLOWEST
from tests.simulation import __main__ as command_line
from tests.simulation import attacks, people, plan
from tests.simulation.attacks import CLAIMS, FAIL_SAFES, FUTURE, REPEATED, VETO, judged
from tests.simulation.faults import ATTACK_KINDS, FAULT_KINDS
from tests.simulation.outcome import Outcome, simulate
from tests.simulation.summary import Summary

from .bugs import BUGS, CASES, PROFILES, QUICK_BUGS, planted

RELEASE = 14.0  # s
ALONE = {
    "thesis": {"F1": 6, "F2": 6, "F3": 4, REPEATED: 6, FUTURE: 6, VETO: 6},
    "quick": {"F1": 4, "F2": 5, "F3": 2, REPEATED: 6, FUTURE: 5, VETO: 5},
}
"""Of six attacks: sometimes a successor turns off before the fail-safe has to."""
THESIS = parameter_file.reaction_to({}, "/")
DAYS = 30  # within which a bug must be found


def day(seed: str, claim: str, profile: str = "thesis") -> Experiment:
    """Return a day in which the controller pauses while it runs, and a claim stands alone later."""
    given = parameter_file.reaction_to(PROFILES[profile], "/")
    scenario = {
        **people.sources(people.RATE),
        "operator": {"pressed": [{"from": 0.0, "to": RELEASE}]},
        "engines": [{"at": at, "command": topics.TURN_ON} for at in (1.5, 12.5, RELEASE + judged(given))],
    }
    pause = PlannedFault(6.0, "stop", CONTROLLER, 1.5)
    faults = attacks.attack(claim, RELEASE, given, random.Random(f"{seed} {claim}"))
    length = RELEASE + judged(given) + 3.0
    return Experiment(seed, length, scenario, [pause, *faults], PROFILES[profile])


def evidence(outcome: Outcome) -> list[object]:
    return [each for finding in outcome.findings for each in finding.evidence]


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("claim", CLAIMS)
def test_each_claim_holds_alone(claim: str, profile: str) -> None:
    counted = 0
    for seed in range(6):
        outcome = simulate(day(str(seed), claim, profile))
        assert evidence(outcome) == []
        if claim != VETO:
            assert set(outcome.alone) <= {claim}
        counted += outcome.alone[claim]
    assert counted >= ALONE[profile][claim]


def test_the_report_says_how_often_each_fail_safe_stood_alone() -> None:
    summary = Summary.of(simulate(day("1", "F1")))
    summary.add(Summary.of(simulate(day("1", "F2"))))
    summary.add(Summary.of(simulate(day("2", "F2"))))
    line = (
        "What stopped the arm alone: F1 once, F2 2 times, F3 0 times, turn_off repeated 0 times, "
        "presence from the future 0 times, two controllers 0 times"
    )
    assert line in command_line.report(summary, 1.0).splitlines()
    assert "alone" not in command_line.report(Summary(hours=1.0), 1.0)


@pytest.mark.parametrize(("name", "profile"), CASES)
def test_a_bug_that_an_attack_shows_is_found(name: str, profile: str) -> None:
    with planted((BUGS | QUICK_BUGS)[name]):
        for number, claim in zip(range(DAYS), itertools.cycle(CLAIMS), strict=False):
            if evidence(simulate(day(f"{name} {number}", claim, profile))):
                return
    pytest.fail(f"{DAYS} attacks have not found that {name}")


def test_random_experiments_attack_each_fail_safe_in_turn() -> None:
    experiments = plan.experiments("1", 2.0, 5.0, list(FAULT_KINDS))
    faults = [each for experiment in experiments for each in experiment.faults]
    stuck, deceived = (sum(each.kind == kind for each in faults) for kind in (STUCK_DRIVE, FALSE_PRESENCE))
    assert 15 < deceived < 40  # F1
    assert abs(stuck - 2 * deceived) <= len(experiments)  # F1 and F2
    assert {each.kind for each in faults} == {*FAULT_KINDS, *ATTACK_KINDS}


def test_chosen_kinds_of_faults_are_without_attacks() -> None:
    kinds = list(FAULT_KINDS)[1:]
    faults = [each for experiment in plan.experiments("1", 1.0, 5.0, kinds) for each in experiment.faults]
    assert {each.kind for each in faults} <= set(kinds)


def test_random_faults_leave_the_attacked_fail_safe_unharmed() -> None:
    for seed in range(5):
        bare = Experiment(str(seed), 600.0, people.operator(str(seed), 600.0, THESIS), [])
        targets = ("operator_watchdog", "engine_controller", "all", "operator", "nothing", "velocity")
        faults = [PlannedFault(float(at), "kill", target, 2.0) for at in range(600) for target in targets]
        whole = attacks.attacked(Experiment(bare.seed, bare.length, bare.scenario, faults))
        planned = attacks.attacked(bare).faults
        releases = [each.at for each in planned if each.kind == STUCK_DRIVE]
        assert releases
        kept = [each for each in whole.faults if each not in planned]
        assert sum(each.target == "velocity" for each in kept) == 600
        for release, fault in itertools.product(releases, kept):
            is_near = release - 6.0 < fault.at + fault.duration and fault.at < release + judged(THESIS)
            assert fault.target == "velocity" or not is_near


def test_watchdog_slower_than_the_bound_of_s1_is_not_attacked_alone() -> None:
    slow = {"/operator_watchdog": {"ros__parameters": {"silence": 4.0}}}
    for parameters, alone in (({}, True), (slow, False)):
        faults = [
            each
            for experiment in plan.experiments("1", 1.0, 5.0, list(FAULT_KINDS), parameters)
            for each in experiment.faults
        ]
        assert any(each.kind == STUCK_DRIVE for each in faults)
        assert any(each.kind == FALSE_PRESENCE for each in faults) is alone


def test_watchdog_sees_the_operator_before_its_messages_are_held() -> None:
    patient = {"/operator_watchdog": {"ros__parameters": {"lifespan": 7.5, "sampling": 1.0, "silence": 5.0}}}
    given = parameter_file.reaction_to(patient, "/")
    for seed, fail_safe in itertools.product(range(20), FAIL_SAFES):
        faults = attacks.attack(fail_safe, RELEASE, given, random.Random(seed))
        held = [each.at for each in faults if each.kind == HOLD]
        killed = min(each.at for each in faults if each.target == WATCHDOG)
        assert all(at > killed + SLOWEST for at in held)
