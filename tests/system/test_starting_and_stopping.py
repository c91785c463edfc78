"""Start and end of a system: in order, by signals, after accidents. No process ever stays behind."""

from __future__ import annotations

import fcntl
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest

from deploy.supervision import manifest
from interfaces.service import instance
from tests.system.sites import Command, Site

STEADY = str(Path(__file__).with_name("steady.yaml"))
PROCESSES = {"", *(program.name for program in manifest.programs())}


@pytest.mark.parametrize(
    ("moment", "number"),
    [
        ("Starting the services", signal.SIGINT),
        ("Starting the services", signal.SIGTERM),
        ("Starting the services", signal.SIGHUP),
        ("Engines are off", signal.SIGINT),
        ("Engines are off", signal.SIGTERM),  # SIGHUP comes when the terminal is closed, below
    ],
)
def test_a_signal_ends_everything(site: Site, number: int, moment: str) -> None:
    command = site.begin("run", STEADY)
    command.await_line(moment)
    command.signal(number)
    assert command.wait() == 0
    assert "All have ended." in command.output
    assert site.members == {}


@pytest.mark.parametrize("moment", ["Starting the services", "Engines are off"])
def test_ctrl_c_at_the_terminal_of_make_run_ends_everything(site: Site, moment: str) -> None:
    terminal = site.begin_in_terminal("make", "run", f"SCENARIO={STEADY}")
    terminal.await_line(moment)
    terminal.type("\x03\x03")
    terminal.wait()
    assert "All have ended." in terminal.output
    assert site.members == {}


@pytest.mark.parametrize("target", ["run", "start"])
@pytest.mark.parametrize("delay", [0.02, 0.1, 0.2, 0.3, 0.5, 0.8, 1.3])
def test_ctrl_c_leaves_a_complete_system_or_nothing(site: Site, target: str, delay: float) -> None:
    command = site.begin_command("make", target, f"SCENARIO={STEADY}")
    time.sleep(delay)  # any moment is a good one
    command.signal(signal.SIGINT)
    command.wait()
    assert "Traceback" not in command.output
    complete = target == "start" and "It runs in the background" in command.output
    assert len(site.members) == (len(PROCESSES) if complete else 0), command.output


def test_a_second_ctrl_c_does_not_interrupt_the_stop(site: Site) -> None:
    command = site.begin("run", STEADY)
    command.await_line("Engines are off")
    with another_at_work(site):
        command.signal(signal.SIGINT)
        command.await_line("Waiting for another make to end its start or stop")
        command.signal(signal.SIGINT)
    assert command.wait() == 0
    assert "All have ended." in command.output
    assert site.members == {}


def test_ctrl_c_before_the_start_ends_without_a_traceback(site: Site) -> None:
    command = site.begin("run", STEADY)
    while signal.SIGHUP not in caught_signals(command.pid):
        assert command.is_alive
    command.signal(signal.SIGINT)
    assert command.wait() == 0
    assert command.output == ""
    assert not site.run.exists()


@pytest.mark.parametrize("send", [os.killpg, os.kill], ids=["at the terminal", "to it alone"])
def test_a_signal_ends_the_reading_of_a_silent_parameter_file(
    site: Site, tmp_path: Path, send: Callable[[int, int], None]
) -> None:
    file = tmp_path / "mine.yaml"
    os.mkfifo(file)
    command = site.begin("run", STEADY, str(file))
    with writer_to_a_reader_of(file, command):
        send(command.pid, signal.SIGINT)
        assert command.wait() == 0
    assert command.output == ""
    assert not site.run.exists()


@contextmanager
def writer_to_a_reader_of(fifo: Path, command: Command) -> Iterator[int]:
    """A writer that writes nothing to a fifo that a command reads."""
    writer = None
    while writer is None:
        assert command.is_alive, command.output
        with suppress(OSError):  # no reader yet
            writer = os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
    try:
        yield writer
    finally:
        os.close(writer)


def caught_signals(pid: int) -> set[int]:
    """The signals that a process handles."""
    status = Path(f"/proc/{pid}/status").read_text()
    mask = int(status.partition("SigCgt:")[2].split()[0], 16)
    return {number for number in range(1, 65) if mask >> (number - 1) & 1}


@contextmanager
def another_at_work(site: Site) -> Iterator[None]:
    """Hold the lock of a start or stop."""
    site.run.mkdir(exist_ok=True)
    directory = os.open(site.run, os.O_RDONLY)
    try:
        fcntl.flock(directory, fcntl.LOCK_EX)
        yield
    finally:
        os.close(directory)


@pytest.mark.parametrize("arguments", [("stop",), ("start", STEADY)], ids=lambda arguments: arguments[0])
def test_ctrl_c_ends_the_wait_for_another_start_or_stop(site: Site, arguments: tuple[str, ...]) -> None:
    with another_at_work(site):
        command = site.begin(*arguments)
        command.await_line("Waiting for another make to end its start or stop")
        command.signal(signal.SIGINT)
        assert command.wait() == 0
    assert len(command.lines) == 1, command.output
    assert site.members == {}


def test_a_start_waits_for_another_start_or_stop(site: Site) -> None:
    with another_at_work(site):
        command = site.begin("start", STEADY)
        command.await_line("Waiting for another make to end its start or stop")
        assert site.members == {}
    command.await_line("It runs in the background")
    assert command.wait() == 0


def test_closing_the_terminal_ends_everything(site: Site) -> None:
    terminal = site.begin_in_terminal("make", "run", f"SCENARIO={STEADY}")
    terminal.await_line("Engines are off")
    members = site.members
    terminal.signal(signal.SIGKILL)
    site.await_members(lambda left: not left)
    assert members.keys() == PROCESSES


def test_nohup_keeps_it_running_when_the_terminal_closes(site: Site) -> None:
    command = site.begin_command("nohup", sys.executable, "-m", "deploy.commands.launcher", "run", STEADY)
    command.await_line("Engines are off")
    command.signal(signal.SIGHUP)
    command.type("turn_on\n")
    command.await_line("Turning on engines")
    command.type("quit\n")
    assert command.wait() == 0


def test_the_end_of_a_pipe_ends_everything(site: Site) -> None:
    run = f"'{sys.executable}' -m deploy.commands.launcher run '{STEADY}'"
    reader = site.begin_in_terminal("sh", "-c", f"{run} | head -n 1")
    reader.await_line("Starting the services")
    site.await_members(lambda left: not left)


def test_it_starts_again_when_supervisord_is_killed(site: Site) -> None:
    command = site.begin("run", STEADY)
    command.await_line("Engines are off")
    before = site.members
    os.kill(before[""], signal.SIGKILL)
    command.await_line("supervisord was killed: everything has been started anew")
    after = site.members
    assert set(after.values()).isdisjoint(before.values())
    command.type("quit\n")
    assert command.wait() == 0
    assert site.members == {}


def test_the_switch_stays_pressed_by_hand_when_its_process_dies(site: Site) -> None:
    command = site.begin("run", STEADY)
    command.await_line("Engines are off")
    command.insist("press\n", "Operator is alive")
    switch = site.members["dead_mans_switch"]
    os.kill(switch, signal.SIGKILL)
    site.await_members(lambda left: left.get("dead_mans_switch", switch) != switch)
    for _ in range(3):  # the first may come from the dead process' last heartbeat
        command.await_line("Operator is alive", after=len(command.lines))
    command.type("quit\n")
    assert command.wait() == 0


def test_make_stop_elsewhere_ends_the_terminal(site: Site) -> None:
    command = site.begin("run", STEADY)
    command.await_line("Engines are off")
    assert site.do("stop")[0] == 0
    command.await_line("The system has ended")
    assert command.wait() == 0
    assert site.members == {}


def orphaned(site: Site) -> dict[str, int]:
    """Start a system and kill its supervisord; the processes that are left."""
    assert site.do("start", STEADY)[0] == 0
    os.kill(site.members[""], signal.SIGKILL)
    site.await_members(lambda left: "" not in left)
    return site.members


def test_stop_ends_the_orphans_of_a_killed_supervisord(site: Site) -> None:
    assert orphaned(site).keys() == PROCESSES - {""}
    code, printed = site.do("status")
    assert code == 1
    assert "supervisord has died" in printed
    assert site.do("stop")[0] == 0
    assert site.members == {}
    assert site.do("stop") == (0, "Nothing runs.")


def test_a_console_reports_that_services_go_on_unsupervised(site: Site) -> None:
    assert site.do("start", STEADY)[0] == 0
    console = site.begin("console")
    console.await_line("Engines are off")
    os.kill(site.members[""], signal.SIGKILL)
    console.await_line("supervisord has died; .* services go on without it")
    assert console.wait() == 0


def test_start_replaces_the_orphans_of_a_killed_supervisord(site: Site) -> None:
    orphans = orphaned(site)
    assert site.do("start", STEADY)[0] == 0
    assert set(site.members.values()).isdisjoint(orphans.values())


@pytest.mark.parametrize("hung", ["", "velocity"])
def test_stop_ends_hanging_processes_within_two_seconds(site: Site, hung: str) -> None:
    assert site.do("start", STEADY)[0] == 0
    os.kill(site.members[hung], signal.SIGSTOP)
    command = site.begin("stop")
    assert command.wait() == 0
    assert site.members == {}
    (begin, _), (end, _) = command.lines
    assert end - begin < 2.0


ERRORS = [
    ("l1: -1.0", "{file}: l1: -1.0 is negative"),
    ("l3: 1.0", "{file}: scenario: unknown key 'l3'"),
    ("l1: [", "{file}: "),
]


@pytest.mark.parametrize(("text", "complaint"), ERRORS)
def test_an_error_in_a_scenario_is_reported_before_the_start(
    site: Site, tmp_path: Path, text: str, complaint: str
) -> None:
    file = tmp_path / "wrong.yaml"
    file.write_text(text)
    code, printed = site.do("run", str(file))
    assert code == 1
    assert printed.startswith(complaint.format(file=file))
    assert "\n" not in printed
    assert not site.run.exists()


def test_an_unknown_scenario_is_reported_with_the_known_ones(site: Site) -> None:
    assert site.do("run", "tango") == (1, "SCENARIO=tango is neither a file nor one of: demo, listing_5_9")


def test_an_impossible_domain_is_reported(site: Site) -> None:
    site.domain = 233
    assert site.do("run", STEADY) == (1, "ROS_DOMAIN_ID=233 is not a number from 0 to 232")


def test_an_impossible_dds_configuration_is_reported(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<no xml")
    code, printed = site.do("run", STEADY)
    assert code == 1
    assert printed.splitlines()[-1].startswith("Cannot join the ROS graph: ")
    assert "Traceback" not in printed
    assert not site.run.exists()


def test_a_run_directory_that_cannot_be_made_is_reported(site: Site, tmp_path: Path) -> None:
    site.run = tmp_path / "file" / "run"
    site.run.parent.touch()
    assert site.do("start", STEADY) == (1, f"[Errno 20] Not a directory: '{site.run}'")
    site.run.parent.unlink()


def test_a_full_disk_is_reported_with_the_file(site: Site) -> None:
    site.run.mkdir()
    (site.run / "parameters.new").symlink_to("/dev/full")
    assert site.do("start", STEADY) == (1, f"{site.run / 'parameters.yaml'}: No space left on device")
    assert site.members == {}


def test_a_quote_in_scenario_is_no_shell_syntax(site: Site) -> None:
    code, printed = site.do_command("make", "start", "SCENARIO=it's")
    assert code != 0
    assert printed.startswith("SCENARIO=it's is neither a file nor one of: demo, listing_5_9")


def test_logs_follow_the_system_until_it_ends(site: Site) -> None:
    code, printed = site.do("logs")
    assert code == 1
    assert printed == f"Nothing runs: make start. The logs of the last run are in {site.run / 'logs'}"
    assert site.do("start", STEADY)[0] == 0
    logs = site.begin("logs")
    logs.await_line("logs/velocity.log")
    assert site.do("stop")[0] == 0
    logs.await_line("The system has ended")
    assert logs.wait() == 0


def test_the_sentinel_runs_only_under_supervisord(site: Site) -> None:
    code, printed = site.do_command(sys.executable, "-m", "deploy.supervision.sentinel")
    assert (code, printed) == (2, "sentinel: runs only under supervisord: make start")


def test_an_impossible_namespace_is_reported(site: Site) -> None:
    site.namespace = "arm 1"
    code, printed = site.do("run", STEADY)
    assert code == 1
    assert printed.startswith("REACTIVE_ARM_NAMESPACE=arm 1 is no namespace such as /arm1: ")
    assert "\n" not in printed


def test_a_second_system_in_the_same_domain_is_refused(site: Site, tmp_path: Path) -> None:
    assert site.do("start", STEADY)[0] == 0
    before = site.members
    with closing(Site(tmp_path / "second", site.domain)) as second:
        code, printed = second.do("start", STEADY)
        assert code == 1
        assert printed == (
            f"ROS domain {site.domain} is in use: the system in {site.run} has /config_l1. Set ROS_DOMAIN_ID"
            " to another domain (0 to 101), or REACTIVE_ARM_NAMESPACE, for example to /arm2."
        )
        assert second.members == {}
        assert not second.run.exists()
    assert site.members == before


def test_a_service_in_the_same_domain_is_reported(site: Site) -> None:
    service = site.begin_command(sys.executable, "-m", "services.velocity")
    while not instance.is_claimed("/velocity", site.domain):
        assert service.is_alive, service.output
        time.sleep(0.02)
    code, printed = site.do("start", STEADY)
    assert code == 1
    assert printed.startswith(f"ROS domain {site.domain} is in use: /velocity already runs on this host. Set")


def test_a_service_that_does_not_start_shows_its_last_words(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    crash = "import os, sys\nif 'services.velocity' in sys.orig_argv: print('crash', flush=True); os._exit(1)"
    (tmp_path / "sitecustomize.py").write_text(crash)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)  # beside a sourced ROS 2
    (site.run / "logs").mkdir(parents=True)
    (site.run / "logs" / "velocity.log").write_text("a line of an earlier start\n")
    code, printed = site.do("start", STEADY)
    assert code == 1
    lines = printed.splitlines()
    assert lines[lines.index("velocity does not start:") + 1 :] == ["crash"]
    assert site.members == {}


def test_the_scenario_begins_when_all_services_are_up(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    slow = "import sys, time\nif 'services.dead_mans_switch' in sys.orig_argv: time.sleep(6.0)"
    (tmp_path / "sitecustomize.py").write_text(slow)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)  # beside a sourced ROS 2
    scenario = tmp_path / "early.yaml"
    scenario.write_text("operator: {pressed: [{from: 0.0}]}\nengines: [{at: 1.0, command: turn_on}]")
    command = site.begin("run", str(scenario))
    command.await_line("All services are up")
    time = command.await_line(r"^\[(\d+)\] Engines are on")[1]
    assert 1000 <= int(time) < 4000


def test_an_error_in_a_parameter_file_is_reported_before_the_start(site: Site, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("operator_watchdog: {ros__parameters: {silence: -1.0}}")
    complaint = f"{file}: operator_watchdog.silence: must be from 0.1 to 60, not -1.0"
    assert site.do("start", STEADY, str(file)) == (1, complaint)
    assert not site.run.exists()


def test_a_parameter_file_may_be_a_pipe(site: Site, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    os.mkfifo(file)
    command = site.begin("run", STEADY, str(file))
    with writer_to_a_reader_of(file, command) as writer:
        os.write(writer, b"dead_mans_switch: {ros__parameters: {pressed: true}}")
    command.await_line("Operator is alive")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_a_signal_to_make_alone_ends_everything(site: Site, number: int) -> None:
    command = site.begin_command("make", "run", f"SCENARIO={STEADY}")
    command.await_line("Engines are off")
    os.kill(command.pid, number)
    site.await_members(lambda left: not left)
    command.wait()
