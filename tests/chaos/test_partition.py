"""The operator's host is cut off from the robot's, and comes back."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from deploy.chaos.findings import HOLDS
from deploy.chaos.history import Fault, History, between
from deploy.chaos.partition import missing, namespaces
from deploy.chaos.promises import CHECKERS
from deploy.supervision import processes
from interfaces.topics import ENGINES_STATE, OFF, ON, OPERATOR_HEARTBEAT

from .plays import play

DISCOVERY = 10.0  # s until a host that was given up is known again
pytestmark = pytest.mark.timeout(120)


@pytest.fixture(scope="module")
def history(tmp_path_factory: pytest.TempPathFactory) -> History:
    """What the robot's side sees."""
    if reason := missing():
        pytest.skip(reason)
    return play(tmp_path_factory.mktemp("partition"), "--scenario", "partition").history


@pytest.fixture(scope="module")
def cut(history: History) -> Fault:
    """The partition."""
    (fault,) = (fault for fault in history.faults if fault.kind == "partition")
    return fault


def test_engines_are_on_until_the_operator_is_cut_off(history: History, cut: Fault) -> None:
    assert {s.value for s in between(history.stream(ENGINES_STATE), cut.begin - 1.0, cut.begin)} == {ON}


def test_engines_go_off_in_time_when_the_operator_is_cut_off(history: History) -> None:
    finding = CHECKERS["S1"](history)
    assert finding.verdict == HOLDS, finding.evidence
    assert finding.cases == 1


def test_heartbeats_are_back_soon_after_the_network(history: History, cut: Fault) -> None:
    heartbeats = history.stream(OPERATOR_HEARTBEAT)
    assert not between(heartbeats, cut.begin + 0.5, cut.end - 0.5)
    assert between(heartbeats, cut.end, cut.end + DISCOVERY)


def test_engines_stay_off_when_the_operator_is_back(history: History, cut: Fault) -> None:
    assert {s.value for s in between(history.stream(ENGINES_STATE), cut.end, history.end)} == {OFF}


@pytest.mark.parametrize("promise", CHECKERS)
def test_no_promise_is_broken(history: History, promise: str) -> None:
    assert not CHECKERS[promise](history).evidence


def test_no_promise_is_broken_by_a_bad_line_and_the_engines_stay_on(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    if reason := missing() or missing("bad_line"):
        # The words of the kernel, not of tc about how it is used.
        assert "Specified qdisc kind is unknown" in reason or reason == missing()
        pytest.skip(f"platform: {reason}")
    bad = play(tmp_path_factory.mktemp("bad_line"), "--scenario", "bad_line")
    (fault,) = (fault for fault in bad.history.faults if fault.kind == "bad_line")
    assert {s.value for s in between(bad.history.stream(ENGINES_STATE), fault.begin, fault.end)} == {ON}
    for promise in CHECKERS:
        bad.finding(promise)


PREPARED = """
import signal, sys
from contextlib import ExitStack
from pathlib import Path
from deploy.chaos.partition import TwoHosts

with ExitStack() as stack:
    TwoHosts(Path(sys.argv[1])).prepare(stack)
    print(flush=True)
    signal.pause()
"""


def test_what_a_killed_monkey_leaves_behind_is_found_by_the_next_one(tmp_path: Path) -> None:
    if reason := missing():
        pytest.skip(reason)
    command = [sys.executable, "-c", PREPARED, str(tmp_path)]
    with subprocess.Popen(command, cwd=processes.ROOT, stdout=subprocess.PIPE) as monkey:
        try:
            assert monkey.stdout is not None
            monkey.stdout.readline()
            with namespaces():  # it lives: what it has made is its own
                assert f"arm{monkey.pid}-switch" in hosts()
        finally:
            monkey.kill()
    assert (tmp_path / "run_operator").is_dir()  # by which make chaos ends the switch of an earlier play
    assert f"arm{monkey.pid}-switch" in hosts()
    with namespaces():
        assert not [name for name in hosts() if name.startswith(f"arm{monkey.pid}-")]


def hosts() -> list[str]:
    """The network namespaces of this machine that have a name."""
    listed = subprocess.run(["ip", "netns", "list"], check=True, capture_output=True, text=True)
    return [line.split()[0] for line in listed.stdout.splitlines()]
