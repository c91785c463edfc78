"""A second whole arm on another host meets the first one: both started while they were cut off."""

from __future__ import annotations

from itertools import pairwise

import pytest

from interfaces import topics
from tests.promises.findings import HOLDS
from tests.promises.history import History, between

from .chaos_runs import ChaosRun, chaos_run, need_two_hosts

pytestmark = [pytest.mark.timed, pytest.mark.timeout(150)]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> ChaosRun:
    need_two_hosts()
    return chaos_run(tmp_path_factory.mktemp("second_host"), "--scenario", "second_host")


@pytest.fixture(scope="module")
def met(run: ChaosRun) -> float:
    """When the record hears the second drive: from then on, its time alternates with the first one's."""
    history = run.history
    times = history.stream(topics.DRIVEN_TIME)
    found = [two.sent for one, two in pairwise(times) if two.value[0] < one.value[0]]
    assert len(found) > 20
    return found[0]


def test_the_hosts_meet_while_all_engines_are_off(run: ChaosRun, met: float) -> None:
    (cut,) = (fault for fault in run.history.faults if fault.kind == "partition")
    assert cut.end - 0.1 < met < cut.end + 10.0
    states = between(run.history.stream(topics.ENGINES_STATE), cut.end, run.history.end)
    assert {each.value for each in states} == {topics.OFF}


@pytest.mark.parametrize("joint", topics.JOINTS, ids=lambda joint: joint.name)
def test_no_joint_moves_though_drives_and_joints_die(run: ChaosRun, met: float, joint: topics.Topic) -> None:
    history: History = run.history
    killed = [fault for fault in history.faults if fault.kind == "kill"]
    assert len(killed) == 4
    stood = between(history.stream(joint), met - 1.0, history.end)
    assert stood[-1].sent > killed[-1].begin + 1.0
    assert len({each.value for each in stood}) == 1


@pytest.mark.parametrize("promise", ["S1", "S3", "S6"])
def test_promises_hold(run: ChaosRun, promise: str) -> None:
    assert run.finding(promise).verdict == HOLDS


def test_no_promise_is_violated(run: ChaosRun) -> None:
    assert {name: finding.evidence for name, finding in run.findings.items() if finding.evidence} == {}
