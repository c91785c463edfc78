"""The network between the operator's host and the robot's is cut, and heals."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from deploy.supervision import processes
from deploy.supervision.system import System
from interfaces.topics import ENGINES_STATE, OFF, ON, OPERATOR_HEARTBEAT
from tests.chaos.partition import missing, namespaces
from tests.promises.findings import HOLDS
from tests.promises.history import History, InjectedFault, between
from tests.promises.lateness import REDISCOVERY
from tests.promises.promises import CHECKERS

from .chaos_runs import chaos_run, need_two_hosts

pytestmark = [pytest.mark.timed, pytest.mark.timeout(120)]


@pytest.fixture(scope="module")
def history(tmp_path_factory: pytest.TempPathFactory) -> History:
    need_two_hosts()
    return chaos_run(tmp_path_factory.mktemp("partition"), "--scenario", "partition").history


@pytest.fixture(scope="module")
def cut(history: History) -> InjectedFault:
    (fault,) = (fault for fault in history.faults if fault.kind == "partition")
    return fault


def test_engines_are_on_before_the_partition(history: History, cut: InjectedFault) -> None:
    assert {s.value for s in between(history.stream(ENGINES_STATE), cut.begin - 1.0, cut.begin)} == {ON}


def test_engines_turn_off_in_time_after_a_partition(history: History) -> None:
    finding = CHECKERS["S1"](history)
    assert finding.verdict == HOLDS, finding.evidence
    assert finding.cases == 1


def test_heartbeats_resume_soon_after_the_network(history: History, cut: InjectedFault) -> None:
    heartbeats = history.stream(OPERATOR_HEARTBEAT)
    # By the time of reception: the kernel may keep a packet whose address it does not know for seconds.
    assert not [heartbeat for heartbeat in heartbeats if cut.begin + 0.5 < heartbeat.received < cut.end]
    assert between(heartbeats, cut.end, cut.end + REDISCOVERY)


def test_engines_stay_off_after_a_partition_heals(history: History, cut: InjectedFault) -> None:
    assert {s.value for s in between(history.stream(ENGINES_STATE), cut.end, history.end)} == {OFF}


@pytest.mark.parametrize("promise", CHECKERS)
def test_no_promise_is_violated(history: History, promise: str) -> None:
    assert not CHECKERS[promise](history).evidence


def test_bad_line_violates_no_promise_and_engines_stay_on(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    need_two_hosts()
    if reason := missing("bad_line"):
        # An error of the kernel; an error in the use of tc would read differently.
        assert "Specified qdisc kind is unknown" in reason
        pytest.skip(f"platform: {reason}")
    bad = chaos_run(tmp_path_factory.mktemp("bad_line"), "--scenario", "bad_line")
    (fault,) = (fault for fault in bad.history.faults if fault.kind == "bad_line")
    assert {s.value for s in between(bad.history.stream(ENGINES_STATE), fault.begin, fault.end)} == {ON}
    for promise in CHECKERS:
        bad.finding(promise)


PREPARED = """
import signal, sys
from contextlib import ExitStack
from pathlib import Path
from tests.chaos.partition import TwoHosts

with ExitStack() as stack:
    TwoHosts(Path(sys.argv[1])).prepare(stack)
    print(flush=True)
    signal.pause()
"""


def test_next_start_cleans_up_after_a_killed_chaos_monkey(tmp_path: Path) -> None:
    need_two_hosts()
    command = [sys.executable, "-c", PREPARED, str(tmp_path)]
    with subprocess.Popen(command, cwd=processes.ROOT, stdout=subprocess.PIPE) as monkey:
        try:
            assert monkey.stdout is not None
            monkey.stdout.readline()
            with namespaces():  # the namespaces of a live process are left alone
                assert f"arm{monkey.pid}-switch" in hosts()
        finally:
            monkey.kill()
    assert (tmp_path / "run_operator").is_dir()  # lets the next make chaos end the switch
    assert f"arm{monkey.pid}-switch" in hosts()
    with namespaces():
        assert not [name for name in hosts() if name.startswith(f"arm{monkey.pid}-")]
    System(tmp_path / "run_operator").stop()  # as the next make chaos does


def hosts() -> list[str]:
    listed = subprocess.run(["ip", "netns", "list"], check=True, capture_output=True, text=True)
    return [line.split()[0] for line in listed.stdout.splitlines()]
