"""What the sentinel decides, on made-up sights."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticStatus

from deploy.supervision.policy import NAME, Action, Judge, Sight
from deploy.supervision.probe import Eyes
from deploy.supervision.processes import Process
from deploy.supervision.sentinel import states
from deploy.supervision.system import DeploymentError, System, Watched

SERVICES = ("engine_controller", "kinematics", "operator_watchdog", "velocity", NAME)
PIDS = {name: 100 + index for index, name in enumerate(SERVICES)}
LOOK = 0.25


def program(name: str, state: str = "RUNNING", pid: int | None = None, age: float = 0.0) -> Watched:
    """A supervised program."""
    up = state in ("RUNNING", "STARTING")
    return Watched(name, state, (pid or PIDS[name]) if up else 0, age, 0, "", "")


class Run:
    """A judge that looks again and again, at services that report once a second unless told otherwise."""

    def __init__(self) -> None:
        self.judge = Judge()
        self.now = 0.0
        self.heard: dict[tuple[str, int], float] = {}
        self.programs = {name: program(name) for name in SERVICES}

    def look(
        self,
        seconds: float,
        *,
        silent: Iterable[str] = (),
        stopped: Iterable[int] = (),
        doubles: Iterable[Process] = (),
    ) -> list[tuple[float, Action]]:
        """What it decides within so many seconds, and when."""
        decided = []
        for _ in range(round(seconds / LOOK)):
            self.now += LOOK
            if self.now % 1.0 == 0:
                for each in self.programs.values():
                    if each.pid and each.name not in silent:
                        self.heard[each.name, each.pid] = self.now
            sight = Sight(
                self.now, self.programs.values(), dict(self.heard), frozenset(stopped), frozenset(doubles)
            )
            decided += [(self.now, action) for action in self.judge.judge(sight)]
        return decided


def test_leaves_services_alone_that_report_their_health() -> None:
    run = Run()
    assert run.look(60.0) == []
    assert not run.judge.confused


def test_kills_a_service_whose_health_stops_within_three_seconds_and_not_before_two_are_missed() -> None:
    run = Run()
    run.look(20.0)
    (when, action), *_ = run.look(5.0, silent=["kinematics"])
    assert action[:3] == ("kill", "kinematics", PIDS["kinematics"])
    assert "no health" in action.why
    assert 22.0 < when < 23.0


def test_gives_a_new_process_time_to_start() -> None:
    run = Run()
    run.look(20.0)
    run.programs["velocity"] = program("velocity", pid=500)
    assert run.look(9.0, silent=["velocity"]) == []
    (_, action), *_ = run.look(2.0, silent=["velocity"])
    assert action[:3] == ("kill", "velocity", 500)


def test_a_new_sentinel_does_not_give_time_to_start_to_what_hangs_already() -> None:
    run = Run()
    run.programs["velocity"] = program("velocity", age=300.0)
    (when, action), *_ = run.look(7.0, silent=["velocity"])
    assert action[:3] == ("kill", "velocity", PIDS["velocity"])
    assert when < 6.0


def test_the_health_of_another_process_of_that_name_counts_for_nothing() -> None:
    run = Run()
    run.look(20.0)
    run.programs["velocity"] = program("velocity", pid=500)
    run.heard["velocity", PIDS["velocity"]] = run.now
    decided = run.look(11.0, silent=["velocity"])
    assert {action.pid for _, action in decided} == {500}


def test_kills_a_stopped_process_even_while_everything_is_silent() -> None:
    run = Run()
    run.look(20.0)
    decided = run.look(4.0, silent=SERVICES, stopped=[PIDS["operator_watchdog"]])
    assert {action.program for _, action in decided} == {"operator_watchdog"}
    assert run.judge.confused


def test_lets_a_process_be_that_was_stopped_briefly() -> None:
    run = Run()
    run.look(20.0)
    for _ in range(5):
        assert run.look(1.0, stopped=[PIDS["velocity"]]) == []
        assert run.look(1.0) == []


def test_kills_nothing_for_its_silence_when_it_does_not_hear_itself() -> None:
    run = Run()
    run.look(20.0)
    assert run.look(10.0, silent=[NAME, "kinematics"]) == []
    assert run.judge.confused == "it does not hear itself"
    assert run.look(2.0) == []
    assert not run.judge.confused


def test_makes_room_for_a_successor_when_it_has_not_heard_itself_for_long() -> None:
    run = Run()
    run.look(20.0)
    decided = run.look(14.0, silent=[NAME, "kinematics"])
    assert {action.program for _, action in decided} == {NAME}
    assert 32.0 < decided[0][0] < 34.0


def test_kills_nothing_for_its_silence_when_most_are_silent_at_once() -> None:
    run = Run()
    run.look(20.0)
    assert run.look(30.0, silent=[name for name in SERVICES if name != NAME]) == []
    assert run.judge.confused == "4 of 5 services are silent at once"
    assert run.look(3.0) == []
    assert not run.judge.confused


def test_kills_nothing_for_its_silence_while_it_has_heard_nobody_yet() -> None:
    run = Run()
    assert {action.program for _, action in run.look(60.0, silent=SERVICES)} <= {NAME}


def test_after_a_pause_of_its_own_it_waits_for_news() -> None:
    run = Run()
    run.look(20.0)
    run.now += 30.0
    assert run.look(2.5, stopped=[PIDS["velocity"]]) == []


def test_on_an_overloaded_machine_on_which_it_looks_late_itself_it_is_more_patient() -> None:
    run = Run()
    run.look(20.0)
    for _ in range(5):
        run.now += 0.75
        assert run.look(LOOK, silent=["velocity"]) == []
    assert run.look(3.0, silent=["velocity"])


def test_ends_a_double_that_does_not_end_itself() -> None:
    run = Run()
    run.look(20.0)
    double = Process(777, "kinematics")
    assert run.look(1.0, doubles=[double]) == []
    assert [action[:3] for _, action in run.look(0.25, doubles=[double])] == [("end", "kinematics", 777)]


def test_revives_what_was_given_up_ever_more_patiently() -> None:
    run = Run()
    run.look(20.0)
    revived = []
    for _ in range(10):
        run.programs["velocity"] = program("velocity", "FATAL")
        decided = run.look(70.0)
        assert all(action.verb == "revive" for _, action in decided)
        revived.append(decided[0][0] - (run.now - 70.0))
        run.programs["velocity"] = program("velocity", "BACKOFF")
        run.look(1.0)
    assert revived[0] == 1.25
    assert revived == sorted(revived)
    assert 60.0 <= revived[-1] <= 61.0


def test_a_program_that_ran_again_is_revived_quickly_the_next_time() -> None:
    run = Run()
    for pid in (501, 502, 503):
        run.programs["velocity"] = program("velocity", "FATAL")
        assert run.look(1.5)[0][1].verb == "revive"
        run.programs["velocity"] = program("velocity", pid=pid)
        assert run.look(5.0) == []


def test_leaves_a_program_alone_that_somebody_has_stopped() -> None:
    run = Run()
    run.programs["velocity"] = program("velocity", "STOPPED")
    assert run.look(30.0) == []


def test_warns_of_a_program_that_dies_again_and_again_though_it_runs_for_a_while_each_time() -> None:
    run = Run()
    for restarts in range(8, 12):  # 8 of them before the sentinel was there
        kinematics = program("kinematics")._replace(restarts=restarts)
        run.programs["kinematics"] = kinematics
        run.look(10.0)
    (status,) = states([kinematics], {}, run.judge.recent, "/sentinel")
    assert (status.level, status.message) == (
        DiagnosticStatus.WARN,
        "RUNNING, restarted 3 times within a minute",
    )
    run.look(45.0)  # it has run ever since
    (status,) = states([kinematics], {}, run.judge.recent, "/sentinel")
    assert (status.level, status.message) == (DiagnosticStatus.OK, "RUNNING")


def test_tells_state_pid_restarts_last_exit_and_why_of_every_process() -> None:
    given_up = Watched("velocity", "FATAL", 0, 0.0, 7, "code 2", "Exited too quickly")
    status, fatal = states([program("kinematics"), given_up], {"velocity": "no health"}, {}, "/sentinel")
    assert (status.level, status.name) == (DiagnosticStatus.OK, "/sentinel: kinematics")
    assert fatal.level == DiagnosticStatus.ERROR
    assert {pair.key: pair.value for pair in fatal.values} == {
        "process": "velocity",
        "state": "FATAL",
        "pid": "0",
        "restarts": "7",
        "last exit": "code 2",
        "why": "no health",
    }


def test_sees_nothing_to_act_on_when_supervisord_is_gone(tmp_path: Path) -> None:
    with pytest.raises(DeploymentError, match="supervisord has died"):
        Eyes(System(tmp_path), os.getpid()).see({})  # which is not whose child this process is
    with pytest.raises(DeploymentError, match="does not answer"):
        Eyes(System(tmp_path), os.getppid()).see({})
