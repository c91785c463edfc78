from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from deploy.supervision import processes, rpc
from deploy.supervision.errors import DeploymentError
from deploy.supervision.policy import Observation, Timeouts
from deploy.supervision.probe import Probe
from deploy.supervision.processes import Process
from deploy.supervision.sentinel import reported, states
from deploy.supervision.supervisord import Program, Supervisord

PIDS = {"velocity": 100, "kinematics": 101}
SUPERVISORD = 9  # the parent of this process may have the pid of another one here
PERIOD = Timeouts.period


FATAL = Program("velocity", "FATAL", 0, 0.0, 7, "code 2", "Exited too quickly", 0.25)


def program(name: str, state: str = "RUNNING", pid: int | None = None) -> Program:
    up = state in ("RUNNING", "STARTING")
    return Program(name, state, (pid or PIDS[name]) if up else 0, 0.0, 0, "", "")


@pytest.mark.parametrize(
    ("given", "recent", "level", "message"),
    [
        (program("velocity"), 2, DiagnosticStatus.OK, "RUNNING"),
        (program("velocity", "STARTING"), 0, DiagnosticStatus.OK, "STARTING"),
        (program("velocity"), 3, DiagnosticStatus.WARN, "RUNNING, restarted 3 times within a minute"),
        (FATAL, 9, DiagnosticStatus.ERROR, "FATAL after 7 restarts Exited too quickly"),
        (program("velocity", "STOPPED"), 0, DiagnosticStatus.ERROR, "STOPPED after 0 restarts"),
    ],
)
def test_state_of_a_process(given: Program, recent: int, level: bytes, message: str) -> None:
    (status,) = states([given], {}, {"velocity": recent}, "/sentinel")
    assert (status.level, status.message) == (level, message)
    assert (status.name, status.hardware_id) == ("/sentinel: velocity", socket.gethostname())


@pytest.mark.parametrize(
    ("state", "reason", "why"),
    [("RUNNING", "", ""), ("RUNNING", "hung", "hung"), ("FATAL", "", FATAL.error), ("FATAL", "hung", "hung")],
)
def test_publishes_state_pid_restarts_exit_and_reason(state: str, reason: str, why: str) -> None:
    reasons = {"velocity": reason} if reason else {}
    (status,) = states([FATAL._replace(state=state, pid=501)], reasons, {}, "/sentinel")
    assert {pair.key: pair.value for pair in status.values} == {
        "process": "velocity",
        "state": state,
        "pid": "501",
        "restarts": "7",
        "uptime": "0.000",
        "last exit": "code 2",
        "away": "0.250",
        "why": why,
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
