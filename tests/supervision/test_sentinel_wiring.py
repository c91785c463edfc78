from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.serialization import serialize_message
from rclpy.time import Time

from deploy.supervision import manifest, processes, sentinel
from deploy.supervision.errors import DeploymentError
from deploy.supervision.machine import FLOOD, Figures
from deploy.supervision.manifest import SENTINEL
from deploy.supervision.policy import Action, Observation, Timeouts
from deploy.supervision.service_manager import notify
from deploy.supervision.supervisord import Program, Supervisord
from interfaces.topics import DIAGNOSTICS
from reactive_node.sampled_reader import BUFFER
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
from tests.component.wiring import Wired

VELOCITY = Program("velocity", "RUNNING", 501, 3.0, 2, "code 1", "")


class Probe:
    def __init__(self) -> None:
        self.programs = [VELOCITY]
        self.failure = ""
        self.observations = 0
        self.made = self.began = 0  # [ns]
        self.threads: set[int] = set()
        self.made_of: tuple[Path, int] | None = None
        self.heard: dict[str, Any] = {}
        self.last_health: dict[tuple[str, int], float] = {}

    def hear(self, reports: Mapping[str, Any]) -> None:
        self.heard.update(reports)

    def observe(self) -> Observation:
        self.observations += 1
        self.began = self.began or time.time_ns()
        self.threads.add(threading.get_ident())
        if self.failure:
            raise DeploymentError(self.failure)
        return Observation(0.0, self.programs, last_health=self.last_health)


class Policy:
    def __init__(self) -> None:
        self.kill_inhibited_by = ""
        self.delayed: list[str] = []
        self.reasons: dict[str, str] = {"velocity": "no health"}
        self.recent_restarts: dict[str, int] = {"velocity": 3}
        self.actions: list[Action] = []
        self.decisions = 0
        self.timeouts: Timeouts | None = None
        self.floods: set[str] = set()
        self.hears_itself = True

    def decide(self, observation: Observation) -> list[Action]:
        self.decisions += 1
        self.floods.add(observation.flood)
        actions, self.actions = self.actions, []
        return actions


class Machine:
    """Warns of what the test has prepared."""

    def __init__(self) -> None:
        self.found: dict[str, str] = {}
        self.skipped = 0
        self.made_of: tuple[Path, float] | None = None

    def warnings(self, seen: Figures) -> dict[str, str]:
        assert seen.loopback_is_up
        return dict(self.found)

    def skip(self) -> None:
        self.skipped += 1


class Sentinel(Wired):
    """A wired sentinel with a probe, a policy and a machine of the test."""

    probe: Probe
    policy: Policy
    machine: Machine
    carried_out: list[tuple[Action, Path, int]]

    def states(self) -> list[Any]:
        """The messages about processes, without the health of the sentinel."""
        return [each for each in self.heard[DIAGNOSTICS.name] if ": " in each.status[0].name]


@pytest.fixture
def wired(make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Any:
    probe, policy, machine = Probe(), Policy(), Machine()
    carried_out: list[tuple[Action, Path, int]] = []

    def make_policy(timeouts: Timeouts) -> Policy:
        policy.timeouts = timeouts
        return policy

    monkeypatch.setenv(processes.MARK, str(tmp_path))
    monkeypatch.setattr("interfaces.service.health.PERIOD", 3600.0)

    def make_probe(run: Path, supervisord: Supervisord) -> Probe:
        probe.made = time.time_ns()
        probe.made_of = (run, supervisord.pid)
        return probe

    def make_machine(run: Path, period: float) -> Machine:
        machine.made_of = run, period
        return machine

    monkeypatch.setattr(sentinel, "Probe", make_probe)
    monkeypatch.setattr(sentinel, "Machine", make_machine)
    monkeypatch.setattr(sentinel, "Policy", make_policy)
    monkeypatch.setattr(
        sentinel,
        "carry_out",
        lambda action, run, supervisord: carried_out.append((action, run, supervisord.pid)),
    )

    def make(**options: Any) -> Sentinel:
        options.setdefault("period", 0.05)
        made = Sentinel(make_node, spin_until, sentinel.wire, inputs=[], outputs=[DIAGNOSTICS], **options)
        made.probe, made.policy, made.machine, made.carried_out = probe, policy, machine, carried_out
        return made

    return make


Notifications = Callable[[], list[str]]


@pytest.fixture
def notifications(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Notifications]:
    """What systemd has been sent so far."""
    heard: list[str] = []

    def listen() -> list[str]:
        with suppress(BlockingIOError):
            while True:
                heard.append(systemd.recv(100).decode())
        return heard

    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        yield listen


@pytest.mark.timed
def test_states_are_published_on_change_and_every_second(wired: Any, spin_until: SpinUntil) -> None:
    watching = wired(namespace="/arm1")
    spin_until(lambda: len(watching.states()) >= 3)
    *_, before, last = watching.states()
    apart = (Time.from_msg(last.header.stamp) - Time.from_msg(before.header.stamp)).nanoseconds
    assert 0.9e9 < apart < 1.8e9
    assert watching.probe.began - watching.probe.made < 0.9e9
    assert watching.probe.threads == {threading.get_ident()}
    # The first repetition, for those who have just discovered the sentinel, comes soon.
    ages = [Time.from_msg(each.header.stamp).nanoseconds - watching.probe.began for each in watching.states()]
    assert any(0.25e9 <= age < 1.0e9 for age in ages)

    (status,) = last.status
    assert status.name == "/arm1/service: velocity"
    assert (status.level, status.message) == (
        DiagnosticStatus.WARN,
        "RUNNING, restarted 3 times within a minute",
    )
    assert {pair.key: pair.value for pair in status.values}["why"] == "no health"

    watching.probe.programs = [VELOCITY._replace(state="BACKOFF", pid=0)]
    spin_until(lambda: watching.states()[-1].status[0].level == DiagnosticStatus.ERROR)
    changed = Time.from_msg(watching.states()[-1].header.stamp)
    assert (changed - Time.from_msg(last.header.stamp)).nanoseconds < 0.9e9


def test_uptime_is_no_change(wired: Any, spin_until: SpinUntil, spin_for: SpinFor) -> None:
    watching = wired()
    spin_until(lambda: len(watching.states()) >= 2)
    before = len(watching.states())
    for uptime in (10.0, 11.0, 12.0, 13.0, 14.0, 15.0):
        watching.probe.programs = [VELOCITY._replace(uptime=uptime)]
        spin_for(0.06)
    assert len(watching.states()) <= before + 1


def test_processes_are_observed_once_at_each_look(wired: Any, spin_until: SpinUntil) -> None:
    watching = wired()
    spin_until(lambda: watching.policy.decisions >= 20)  # beyond the first state that is repeated
    assert watching.probe.observations == watching.policy.decisions


@pytest.mark.parametrize("namespace", ["", "/armX"])
def test_health_reports_of_the_namespace_reach_the_probe(
    wired: Any, spin_until: SpinUntil, namespace: str
) -> None:
    watching = wired(namespace=namespace)
    watching.remarks()
    spin_until(lambda: "service" in watching.probe.heard)
    assert watching.probe.heard["service"].pid == os.getpid()


def test_program_that_another_host_runs_as_well_is_reported(
    wired: Any, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(manifest, "programs", lambda: (manifest.Program("service", "services.drive", ()),))
    watching = wired()
    watching.remarks()
    spin_until(lambda: "service" in watching.probe.heard)
    assert watching.remarks() == []
    monkeypatch.setattr(sentinel, "is_here", lambda host: host != socket.gethostname())
    expected = f"service: it runs on host {socket.gethostname()} as well"
    spin_until(lambda: any(remark.startswith(expected) for remark in watching.remarks()))


def test_actions_are_carried_out_and_reported(wired: Any, spin_until: SpinUntil, tmp_path: Path) -> None:
    watching = wired(health_timeout=3.0, start_timeout=6.0)
    assert watching.policy.timeouts == Timeouts(0.05, 3.0, 6.0)
    assert watching.probe.made_of == (tmp_path, os.getppid())
    action = Action("kill", "velocity", 501, "no health for 3.0 s")
    watching.policy.actions = [action]
    spin_until(lambda: watching.carried_out)

    assert watching.carried_out == [(action, tmp_path, os.getppid())]
    assert watching.remarks() == ["velocity: kill: no health for 3.0 s"]


def test_reason_to_kill_no_silent_service_is_reported(wired: Any, spin_until: SpinUntil) -> None:
    watching = wired()
    watching.policy.kill_inhibited_by = "3 of 4 services are silent at once"
    spin_until(watching.remarks)

    assert all(
        each.startswith("sentinel: kills no silent service: 3 of 4 services are silent at once")
        for each in watching.remarks()
    )
    watching.policy.actions = [Action("kill", "velocity", 501, "stopped for 3.0 s")]
    spin_until(lambda: watching.carried_out)  # what the kernel reports is certain


def test_service_that_the_machine_delays_is_reported(wired: Any, spin_until: SpinUntil) -> None:
    watching = wired()
    watching.policy.delayed = ["velocity"]
    spin_until(watching.remarks)
    assert watching.remarks()[0].startswith(
        "velocity: its loop is late, because the machine or a flood keeps it from running"
    )


def test_flood_is_reported_and_the_policy_knows_it(wired: Any, spin_until: SpinUntil) -> None:
    watching = wired()
    spin_until(lambda: watching.policy.floods)
    assert watching.policy.floods == {""}
    watching.machine.found = {FLOOD: "many datagrams arrive"}
    spin_until(lambda: "many datagrams arrive" in watching.policy.floods)
    assert "flood: many datagrams arrive" in watching.remarks()


def test_lost_reports_are_reported_with_their_sender(
    wired: Any, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    watching = wired()
    publisher = watching.peer.create_publisher(DIAGNOSTICS.type, DIAGNOSTICS.name, 2 * BUFFER)
    octets = serialize_message(DiagnosticArray(status=[DiagnosticStatus(name="wheel: motor")]))
    spin_until(lambda: publisher.get_subscription_count() >= 2)

    def is_known() -> bool:
        for _ in range(2 * BUFFER):
            publisher.publish(octets)
        spin_for(0.2)  # two looks and more
        return DIAGNOSTICS.name in watching.service.health.standing

    spin_until(is_known)
    words = watching.service.health.standing[DIAGNOSTICS.name]
    assert words.startswith("so many messages arrive that reports of health are lost, most of them about ")
    assert "'wheel: motor'" in words
    assert "'/peer'" in words
    spin_until(lambda: words in watching.policy.floods)


def test_simulated_time_that_stands_still_stops_no_supervision(
    wired: Any, spin_until: SpinUntil, notifications: Notifications
) -> None:
    watching = wired(use_sim_time=True)
    spin_until(lambda: len(watching.states()) >= 3)
    assert watching.service.get_clock().now().nanoseconds == 0
    spin_until(lambda: notifications().count("WATCHDOG=1") >= 2)
    stamp = Time.from_msg(watching.states()[-1].header.stamp).nanoseconds
    assert abs(time.time_ns() - stamp) < 10e9, "reports carry the time of day, by which hosts compare clocks"


def test_failed_observation_is_reported_and_repeats_no_state(
    wired: Any, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    watching = wired()
    spin_until(lambda: len(watching.states()) >= 2)
    watching.probe.failure = "supervisord has died"
    spin_until(watching.remarks)
    assert watching.remarks()[0].startswith(f"{SENTINEL}: supervisord has died")
    before = len(watching.states())
    spin_for(1.5)
    assert len(watching.states()) == before

    watching.probe.failure = ""
    watching.probe.programs = [VELOCITY._replace(state="FATAL", pid=0)]
    spin_until(lambda: "FATAL" in watching.states()[-1].status[0].message)


def test_warnings_of_the_machine_stand_in_each_report(
    wired: Any, spin_until: SpinUntil, tmp_path: Path
) -> None:
    watching = wired(period=0.06)
    assert watching.machine.made_of == (tmp_path, 0.06)
    watching.machine.found = {"disk": "it is nearly full", "overload": "timers come late"}
    spin_until(lambda: watching.service.health.standing)
    expected = "disk: it is nearly full; overload: timers come late"
    assert watching.remarks() == [expected]
    assert watching.remarks() == [expected, expected]

    watching.machine.found = {}
    spin_until(lambda: not watching.service.health.standing)
    assert watching.remarks() == [expected, expected]


def test_a_look_that_waited_for_supervisord_makes_no_overload(wired: Any, spin_until: SpinUntil) -> None:
    watching = wired()
    assert watching.machine.skipped == 0
    watching.probe.failure = "supervisord does not answer"
    spin_until(lambda: watching.machine.skipped)


# systemd


def test_systemd_is_notified_once_that_all_services_are_up(
    wired: Any, spin_until: SpinUntil, notifications: Notifications
) -> None:
    watching = wired()
    watching.probe.last_health = {("velocity", 400): 0.0}  # of an earlier process
    spin_until(lambda: notifications().count("WATCHDOG=1") == 2)
    assert "READY=1" not in notifications()

    watching.probe.last_health = {("velocity", VELOCITY.pid): 0.0}
    spin_until(lambda: "READY=1" in notifications())
    spin_until(lambda: notifications().count("WATCHDOG=1") == 4)
    assert notifications().count("READY=1") == 1


def test_systemd_is_not_notified_that_a_deaf_sentinel_is_alive(
    wired: Any, spin_until: SpinUntil, spin_for: SpinFor, notifications: Notifications
) -> None:
    watching = wired()
    spin_until(lambda: "WATCHDOG=1" in notifications())
    watching.policy.hears_itself = False
    before = len(notifications())
    spin_for(1.5)
    assert len(notifications()) == before

    watching.policy.hears_itself = True
    spin_until(lambda: len(notifications()) > before)
    watching.probe.failure = "supervisord does not answer"
    spin_until(watching.remarks)
    before = len(notifications())
    spin_for(1.5)
    assert len(notifications()) == before


def test_an_abstract_address_of_systemd_is_notified_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_NONBLOCK) as systemd:
        systemd.bind("")  # the kernel chooses an abstract address
        monkeypatch.setenv("NOTIFY_SOCKET", f"@{systemd.getsockname()[1:].decode()}")
        notify("READY=1")
        assert systemd.recv(100) == b"READY=1"


def test_systemd_that_is_gone_or_full_changes_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, notifications: Notifications
) -> None:
    for _ in range(100_000):  # more than fit
        notify("WATCHDOG=1")
    monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "gone"))
    notify("WATCHDOG=1")
    monkeypatch.delenv("NOTIFY_SOCKET")
    notify("WATCHDOG=1")
    assert notifications()


# Actions


class Answering(Supervisord):
    def watch(self) -> list[Program]:
        return []


def test_kill_reaches_the_process_of_the_program_only(tmp_path: Path) -> None:
    mark = {processes.MARK: str(tmp_path), "SUPERVISOR_PROCESS_NAME": "velocity"}
    code = "import sys; print(flush=True); [print(line, flush=True) for line in sys.stdin]"
    command, pipe = [sys.executable, "-c", code], subprocess.PIPE
    with subprocess.Popen(command, env=os.environ | mark, stdin=pipe, stdout=pipe) as process:
        try:
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdout.readline()
            sentinel.carry_out(Action("kill", "kinematics", process.pid, ""), tmp_path, Answering(1))
            sentinel.carry_out(Action("kill", "velocity", process.pid, ""), tmp_path / "other", Answering(1))
            # A supervisord that does not answer would not replace the process.
            sentinel.carry_out(Action("kill", "velocity", process.pid, ""), tmp_path, Supervisord(1))
            process.stdin.write(b"alive\n")
            process.stdin.flush()
            assert process.stdout.readline() == b"alive\n"
            sentinel.carry_out(Action("kill", "velocity", process.pid, ""), tmp_path, Answering(1))
            assert process.wait(5.0) == -signal.SIGKILL
        finally:
            process.kill()


def test_revival_asks_supervisord_and_may_fail(tmp_path: Path) -> None:
    asked: list[tuple[int, str]] = []

    class Asked(Supervisord):
        def revive(self, program: str) -> None:
            asked.append((self.pid, program))
            raise DeploymentError("it does not answer")

    sentinel.carry_out(Action("revive", "velocity", 0, ""), tmp_path, Asked(7))

    assert asked == [(7, "velocity")]
