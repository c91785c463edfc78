"""The promises in one short run of a real system: every kind of fault, and every program killed."""

from __future__ import annotations

import pytest

from interfaces.topics import DRIVE_TIMEOUT, ENGINES, OPERATOR_HEARTBEAT, OPERATOR_PRESENCE
from tests.chaos.clock import missing
from tests.chaos.faults import PROGRAMS
from tests.promises.effects import TRANSPORT
from tests.promises.findings import HOLDS
from tests.promises.history import OVERLOAD, SILENCE, Sample, between, running
from tests.promises.marks import STEP
from tests.promises.promises import CHECKERS

from .chaos_runs import ChaosRun, chaos_run

pytestmark = [pytest.mark.timed, pytest.mark.timeout(180)]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> ChaosRun:
    return chaos_run(tmp_path_factory.mktemp("variously"), "--scenario", "variously")


@pytest.mark.parametrize("promise", CHECKERS)
def test_promise_is_exercised_and_holds(run: ChaosRun, promise: str) -> None:
    assert run.finding(promise).verdict == HOLDS


@pytest.mark.parametrize("program", PROGRAMS)
def test_killed_program_is_back_within_two_seconds(run: ChaosRun, program: str) -> None:
    assert max(run.finding("L1").times[program]) <= 2.0


def test_engines_turn_off_in_time_with_a_stopped_controller(run: ChaosRun) -> None:
    history = run.history
    sleep = next(each for each in history.conditions if each.kind == SILENCE and each.begin > 0.0)
    begin = between(history.stream(OPERATOR_HEARTBEAT), 0.0, sleep.begin + 1.0)[-1].sent
    off = max(off for on, off in running(history) if on < sleep.end)
    stop = next(f for f in history.faults if (f.kind, f.target) == ("stop", "engine_controller"))
    assert stop.begin < off <= stop.begin + DRIVE_TIMEOUT + TRANSPORT  # by the drive, without a command
    assert not between(history.stream(ENGINES), begin, off)  # the watchdog has lost its strikes
    assert off - begin <= history.reaction.off_within


def test_hung_programs_and_a_stopped_sentinel_are_replaced(run: ChaosRun) -> None:
    found = run.finding("L4")
    overloaded = any(each.kind == OVERLOAD for each in run.history.conditions)
    assert found.times.keys() <= {"kinematics", "config_l1", "sentinel"}
    assert len(found.times) + (found.unknown if overloaded else 0) >= 3


@pytest.mark.skipif(bool(missing()), reason=f"platform: {missing()}")
def test_time_of_day_of_the_arm_steps_forward_and_back(run: ChaosRun) -> None:
    steps = [fault for fault in run.history.faults if fault.kind == STEP]
    assert len(steps) == 2
    presences = run.history.stream(OPERATOR_PRESENCE)

    def ahead(presence: Sample) -> float:  # its value is its stamp
        return float(presence.value) - presence.sent - (presences[0].value - presences[0].sent)

    for step in steps:
        after = next(presence for presence in presences if presence.sent > step.begin + 1.5)
        assert ahead(after) == pytest.approx(step.ahead, abs=1.0)
    assert steps[0].ahead < 0.0 < steps[1].ahead - steps[0].ahead


def test_killed_supervisord_leaves_no_second_instance(run: ChaosRun) -> None:
    supervisors = [life for life in run.history.lives if not life.program]
    assert len(supervisors) == 2
    assert run.finding("S5").cases >= len(PROGRAMS)


def test_every_output_flows_at_the_end(run: ChaosRun) -> None:
    history = run.history
    silent = {p for p in PROGRAMS if history.output(p)[-1].received < history.end - 3.0}
    assert not silent


def test_exit_code_output_and_page_show_cost_and_verdict(run: ChaosRun) -> None:
    assert run.code == 0, run.output
    assert f") in {len(PROGRAMS) + 1} processes per arm" in run.output
    page = run.report.read_text(encoding="utf-8")
    assert "<h1 class=violated>" not in page
    assert page.count("<svg") >= 2
    page = page.replace("http://www.w3.org/2000/svg", "")  # a name, not an address
    assert not any(word in page for word in ("http:", "https:", "src="))


def test_killed_processes_leave_nothing_in_shared_memory(run: ChaosRun) -> None:
    assert {kill.kind for kill in run.history.faults} >= {"kill", "kill_all", "kill_supervisor"}
    assert not run.left_in_shared_memory
