from __future__ import annotations

import os
import socket
from collections.abc import Iterable
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from deploy.supervision import processes, rpc
from deploy.supervision.errors import DeploymentError
from deploy.supervision.manifest import SENTINEL
from deploy.supervision.policy import Action, Observation, Policy, Timeouts
from deploy.supervision.probe import Probe
from deploy.supervision.processes import Process
from deploy.supervision.sentinel import reported, states
from deploy.supervision.supervisord import Program, Supervisord

SERVICES = ("engine_controller", "kinematics", "operator_watchdog", "velocity", SENTINEL)
PIDS = {name: 100 + index for index, name in enumerate(SERVICES)}
SUPERVISORD = 9  # the parent of this process may have the pid of another one here
PERIOD = Timeouts.period


def program(name: str, state: str = "RUNNING", pid: int | None = None, uptime: float = 0.0) -> Program:
    up = state in ("RUNNING", "STARTING")
    return Program(name, state, (pid or PIDS[name]) if up else 0, uptime, 0, "", "")


class Run:
    """A policy with observations of services that report once a second, except the silent ones."""

    def __init__(self) -> None:
        self.policy = Policy()
        self.now = 0.0
        self.last_beat: dict[int, float] = {}
        self.last_health: dict[tuple[str, int], float] = {}
        self.programs = {name: program(name) for name in SERVICES}

    def observe(
        self,
        seconds: float,
        *,
        silent: Iterable[str] = (),
        stopped: Iterable[int] = (),
    ) -> list[tuple[float, Action]]:
        decided = []
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            if self.now % 1.0 == 0:
                for each in self.programs.values():
                    if each.pid and each.name not in silent:
                        self.last_beat[each.pid] = self.last_health[each.name, each.pid] = self.now
            observation = Observation(
                self.now,
                [*self.programs.values()],
                dict(self.last_beat),
                dict(self.last_health),
                stopped=frozenset(stopped),
            )
            decided += [(self.now, action) for action in self.policy.decide(observation)]
        return decided


def test_ignores_the_health_of_another_process_of_that_name() -> None:
    run = Run()
    run.observe(20.0)
    run.programs["velocity"] = program("velocity", pid=500)
    run.last_health["velocity", PIDS["velocity"]] = run.now
    decided = run.observe(11.0, silent=["velocity"])
    assert {action.pid for _, action in decided} == {500}


def test_kills_a_stopped_process_even_while_all_are_silent() -> None:
    run = Run()
    run.observe(20.0)
    decided = run.observe(4.0, silent=SERVICES, stopped=[PIDS["operator_watchdog"]])
    assert {action.program for _, action in decided} == {"operator_watchdog"}
    assert run.policy.kill_inhibited_by


def test_spares_a_process_that_is_stopped_briefly() -> None:
    run = Run()
    run.observe(20.0)
    for _ in range(5):
        assert run.observe(1.0, stopped=[PIDS["velocity"]]) == []
        assert run.observe(1.0) == []


def test_kills_no_silent_service_when_it_does_not_hear_itself() -> None:
    run = Run()
    run.observe(20.0)
    assert run.observe(10.0, silent=[SENTINEL, "kinematics"]) == []
    assert run.policy.kill_inhibited_by == "the sentinel does not hear itself"
    assert run.observe(2.0) == []
    assert not run.policy.kill_inhibited_by


def test_reports_whether_it_hears_itself() -> None:
    run = Run()
    run.observe(20.0, silent=["kinematics", "velocity"])
    assert run.policy.hears_itself
    run.observe(11.0, silent=[SENTINEL])
    assert not run.policy.hears_itself
    run.observe(2.0)
    assert run.policy.hears_itself


def test_an_observation_is_complete_when_each_present_process_has_reported() -> None:
    programs = [program("velocity"), program("kinematics")]
    reports = {("velocity", PIDS["velocity"]): 1.0, ("kinematics", 999): 1.0}
    assert not Observation(2.0, programs, last_health=reports).is_complete
    reports[("kinematics", PIDS["kinematics"])] = 2.0
    assert Observation(2.0, programs, last_health=reports).is_complete
    more = [*programs, program(SENTINEL, "BACKOFF")]
    assert not Observation(2.0, more, last_health=reports).is_complete


def test_ends_itself_when_it_does_not_hear_itself_for_long() -> None:
    run = Run()
    run.observe(20.0)
    decided = run.observe(14.0, silent=[SENTINEL, "kinematics"])
    assert {action.program for _, action in decided} == {SENTINEL}
    assert 32.0 < decided[0][0] < 34.0


def test_kills_no_silent_service_when_most_are_silent_at_once() -> None:
    run = Run()
    run.observe(20.0)
    assert run.observe(30.0, silent=[name for name in SERVICES if name != SENTINEL]) == []
    assert run.policy.kill_inhibited_by == "4 of 5 services are silent at once"
    assert run.observe(3.0) == []
    assert not run.policy.kill_inhibited_by


def test_kills_no_silent_service_before_the_first_health() -> None:
    run = Run()
    assert {action.program for _, action in run.observe(60.0, silent=SERVICES)} <= {SENTINEL}


def test_spares_a_program_that_was_stopped_on_purpose() -> None:
    run = Run()
    run.programs["velocity"] = program("velocity", "STOPPED")
    assert run.observe(30.0) == []


def test_warns_of_a_program_that_dies_again_and_again() -> None:
    run = Run()
    for restarts in range(8, 12):  # 8 of them before the sentinel was there
        kinematics = program("kinematics")._replace(restarts=restarts)
        run.programs["kinematics"] = kinematics
        run.observe(10.0)
    (status,) = states([kinematics], {}, run.policy.recent_restarts, "/sentinel")
    assert (status.level, status.message) == (
        DiagnosticStatus.WARN,
        "RUNNING, restarted 3 times within a minute",
    )
    run.observe(45.0)  # it has run ever since
    (status,) = states([kinematics], {}, run.policy.recent_restarts, "/sentinel")
    assert (status.level, status.message) == (DiagnosticStatus.OK, "RUNNING")


def test_publishes_state_pid_restarts_exit_and_reason() -> None:
    given_up = Program("velocity", "FATAL", 0, 0.0, 7, "code 2", "Exited too quickly", 0.25)
    status, fatal = states([program("kinematics"), given_up], {"velocity": "no health"}, {}, "/sentinel")
    assert (status.level, status.name) == (DiagnosticStatus.OK, "/sentinel: kinematics")
    assert fatal.level == DiagnosticStatus.ERROR
    assert {pair.key: pair.value for pair in fatal.values} == {
        "process": "velocity",
        "state": "FATAL",
        "pid": "0",
        "restarts": "7",
        "uptime": "0.000",
        "last exit": "code 2",
        "away": "0.250",
        "why": "no health",
    }


def test_states_are_read_as_they_were_published() -> None:
    programs = [
        Program("kinematics", "RUNNING", 7, 1.5, 3, "killed by a signal", "", 0.25),
        program("velocity", "BACKOFF"),
    ]
    message = DiagnosticArray(status=states(programs, {}, {}, "/arm/sentinel"))
    assert reported(message, "/arm") == [each._replace(host=socket.gethostname()) for each in programs]
    assert reported(message, "") == []


def test_states_that_make_no_sense_are_not_read() -> None:
    (status,) = states([program("kinematics")], {}, {}, "/sentinel")
    for wrong in (status.values[:3], [KeyValue(key=it.key, value=it.value + "x") for it in status.values]):
        assert reported(DiagnosticArray(status=[DiagnosticStatus(name=status.name, values=wrong)]), "") == []


@pytest.mark.parametrize("time", ["-1", "nan", "inf", "1e300"])
@pytest.mark.parametrize("key", ["uptime", "away"])
def test_states_with_an_impossible_time_are_not_read(key: str, time: str) -> None:
    (status,) = states([program("kinematics")], {}, {}, "/sentinel")
    status.values = [KeyValue(key=it.key, value=time if it.key == key else it.value) for it in status.values]
    assert reported(DiagnosticArray(status=[status]), "") == []


def test_observes_nothing_when_supervisord_is_gone(tmp_path: Path) -> None:
    with pytest.raises(DeploymentError, match="supervisord has died"):
        Probe(tmp_path, Supervisord(os.getpid())).observe()  # which is not whose child this process is
    with pytest.raises(DeploymentError, match="does not answer"):
        Probe(tmp_path, Supervisord(os.getppid())).observe()


def test_a_supervisord_of_another_version_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = ([{"name": "velocity"}], '[{"name": "velocity", "mood": "good"}]', "velocity RUNNING")
    for answer in answers:
        monkeypatch.setattr(rpc, "call", lambda *_, answer=answer, **__: answer)
        with pytest.raises(DeploymentError, match=r"supervisord \(pid 7\) runs another version"):
            Supervisord(7).watch()


class Machine:
    def __init__(self, monkeypatch: pytest.MonkeyPatch, run: Path) -> None:
        self.now = 0.0
        self.questions: list[float] = []
        self.searches: list[float] = []
        self.search_time = 0.0
        self.found: list[Process] = []
        self.programs = [program("velocity"), program("kinematics")]
        self.states = {each.pid: ["S", str(SUPERVISORD)] for each in self.programs}
        machine = self

        class Asked(Supervisord):
            def watch(self) -> list[Program]:
                machine.questions.append(machine.now)
                return list(machine.programs)

        def search(run: Path) -> list[Process]:
            self.searches.append(self.now)
            self.now += self.search_time
            return self.found

        monkeypatch.setattr("time.monotonic", lambda: self.now)
        monkeypatch.setattr("os.getppid", lambda: SUPERVISORD)
        monkeypatch.setattr(processes, "stat_of", lambda pid: self.states.get(pid, []))
        monkeypatch.setattr(processes, "effort_of", lambda pid, stat: None)  # these pids may be real ones
        monkeypatch.setattr(processes, "of_system", search)
        self.probe = Probe(run, Asked(SUPERVISORD))

    def observe(self, times: int = 1) -> Observation:
        for _ in range(times):
            self.now += PERIOD
            observation = self.probe.observe()
        return observation


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Machine:
    return Machine(monkeypatch, tmp_path)


def test_asks_supervisord_once_a_second_while_all_run(machine: Machine) -> None:
    machine.observe(times=6)
    assert machine.questions == [0.5, 1.5, 2.5]


@pytest.mark.parametrize("state", [[], ["Z", str(SUPERVISORD)], ["S", "1"]], ids=["no", "dead", "another"])
def test_asks_supervisord_at_once_when_a_process_has_ended(machine: Machine, state: list[str]) -> None:
    machine.observe(times=2)
    machine.states[PIDS["velocity"]] = state
    machine.programs[0] = program("velocity", pid=900)
    machine.states[900] = ["T", str(SUPERVISORD)]
    observation = machine.observe()
    assert machine.questions == [PERIOD, 3 * PERIOD]
    assert observation.programs == machine.programs
    assert observation.stopped == {900}


@pytest.mark.parametrize("state", ["STARTING", "BACKOFF", "FATAL"])
def test_asks_supervisord_often_while_a_program_does_not_run(machine: Machine, state: str) -> None:
    machine.programs[0] = program("velocity", state)
    assert machine.observe(times=3).programs == machine.programs
    assert machine.questions == [PERIOD, 2 * PERIOD, 3 * PERIOD]


def test_sees_a_stopped_process_at_once(machine: Machine) -> None:
    assert machine.observe().stopped == frozenset()
    machine.states[PIDS["velocity"]][0] = "T"
    assert machine.observe().stopped == {PIDS["velocity"]}
    assert machine.questions == [PERIOD]


def test_searches_for_duplicates_are_rare_where_they_take_long(machine: Machine) -> None:
    machine.search_time = 0.002
    machine.observe(times=6)
    assert [round(each) for each in machine.searches] == [0, 3]
    machine.search_time = 1.0
    machine.observe(times=30)
    assert [round(each) for each in machine.searches[2:]] == [5, 15]


def test_duplicate_is_searched_for_again_within_a_second(machine: Machine) -> None:
    machine.search_time = 0.002
    machine.found = [Process(777, "velocity")]
    machine.states[777] = ["S", "1"]
    assert machine.observe().duplicates == {Process(777, "velocity")}
    machine.found = []
    assert machine.observe(times=2).duplicates == frozenset()
