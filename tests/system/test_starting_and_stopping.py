"""How a system begins and ends: in order, against its will, after accidents. Nothing ever stays behind."""

from __future__ import annotations

import fcntl
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest

from tests.system import pauses
from tests.system.sites import Command, Site

STEADY = str(Path(__file__).with_name("steady.yaml"))


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


def test_ctrl_c_before_anything_has_started_ends_it_without_a_traceback(site: Site) -> None:
    command = site.begin("run", STEADY)
    while signal.SIGHUP not in caught_signals(command.pid):
        assert command.is_alive
    command.signal(signal.SIGINT)
    assert command.wait() == 0
    assert command.output == ""
    assert not site.run.exists()


@pytest.mark.parametrize("send", [os.killpg, os.kill], ids=["at the terminal", "to it alone"])
def test_a_signal_while_a_parameter_file_is_read_is_no_mistake_in_it(
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
    """Somebody on whose words a reader of a fifo, one of a command's processes, waits already."""
    writer = None
    while writer is None:
        assert command.is_alive, command.output
        with suppress(OSError):  # nobody reads yet
            writer = os.open(fifo, os.O_WRONLY | os.O_NONBLOCK)
    try:
        yield writer
    finally:
        os.close(writer)


def caught_signals(pid: int) -> set[int]:
    """The signals that a process handles itself."""
    status = Path(f"/proc/{pid}/status").read_text()
    mask = int(status.partition("SigCgt:")[2].split()[0], 16)
    return {number for number in range(1, 65) if mask >> (number - 1) & 1}


@contextmanager
def another_at_work(site: Site) -> Iterator[None]:
    """A start or stop of the system that takes its time."""
    site.run.mkdir()
    directory = os.open(site.run, os.O_RDONLY)
    try:
        fcntl.flock(directory, fcntl.LOCK_EX)
        yield
    finally:
        os.close(directory)


@pytest.mark.parametrize("arguments", [("stop",), ("start", STEADY)], ids=lambda arguments: arguments[0])
def test_ctrl_c_ends_the_waiting_for_another_start_or_stop(site: Site, arguments: tuple[str, ...]) -> None:
    with another_at_work(site):
        command = site.begin(*arguments)
        command.await_line("Waiting for another make to end its start or stop")
        command.signal(signal.SIGINT)
        assert command.wait() == 0
    assert len(command.lines) == 1, command.output
    assert site.members == {}


def test_a_start_goes_on_when_another_start_or_stop_is_over(site: Site) -> None:
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
    assert len(members) >= 10


def test_nohup_lets_it_go_on_when_the_terminal_closes(site: Site) -> None:
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


def test_it_is_started_anew_when_supervisord_is_killed(site: Site) -> None:
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


def test_the_switch_stays_in_the_hand_of_who_took_it_though_its_process_dies(site: Site) -> None:
    command = site.begin("run", STEADY)
    command.await_line("Engines are off")
    command.insist("press\n", "Operator is alive")
    switch = site.members["dead_mans_switch"]
    os.kill(switch, signal.SIGKILL)
    site.await_members(lambda left: left.get("dead_mans_switch", switch) != switch)
    for _ in range(3):  # the first may be of the dead process' last heartbeat
        command.await_line("Operator is alive", after=len(command.lines))
    command.type("quit\n")
    assert command.wait() == 0


def test_stopping_from_elsewhere_ends_the_terminal_too(site: Site) -> None:
    command = site.begin("run", STEADY)
    command.await_line("Engines are off")
    assert site.do("stop")[0] == 0
    command.await_line("The system has ended")
    assert command.wait() == 0
    assert site.members == {}


def orphaned(site: Site) -> dict[str, int]:
    """The services of a system whose supervisord was killed."""
    assert site.do("start", STEADY)[0] == 0
    os.kill(site.members[""], signal.SIGKILL)
    site.await_members(lambda left: "" not in left)
    return site.members


def test_stop_ends_what_a_killed_supervisord_left_behind(site: Site) -> None:
    assert len(orphaned(site)) >= 9
    code, printed = site.do("status")
    assert code == 1
    assert "supervisord has died" in printed
    assert site.do("stop")[0] == 0
    assert site.members == {}
    assert site.do("stop") == (0, "Nothing runs.")


def test_a_console_tells_that_the_services_go_on_without_supervisord(site: Site) -> None:
    assert site.do("start", STEADY)[0] == 0
    console = site.begin("console")
    console.await_line("Engines are off")
    os.kill(site.members[""], signal.SIGKILL)
    console.await_line("supervisord has died; .* services go on without it")
    assert console.wait() == 0


def test_start_replaces_what_a_killed_supervisord_left_behind(site: Site) -> None:
    orphans = orphaned(site)
    assert site.do("start", STEADY)[0] == 0
    assert set(site.members.values()).isdisjoint(orphans.values())


@pytest.mark.parametrize("hung", ["", "velocity"])
def test_stop_ends_what_hangs_within_two_seconds(site: Site, hung: str) -> None:
    assert site.do("start", STEADY)[0] == 0
    os.kill(site.members[hung], signal.SIGSTOP)
    with pauses.watched() as paused:
        command = site.begin("stop")
        assert command.wait() == 0
    assert site.members == {}
    (begin, _), (end, _) = command.lines
    assert end - begin < 2.0 + paused.total


MISTAKES = [
    ("l1: -1.0", "{file}: l1: -1.0 is negative"),
    ("l3: 1.0", "{file}: scenario: unknown key 'l3'"),
    ("l1: [", "{file}: "),
]


@pytest.mark.parametrize(("text", "complaint"), MISTAKES)
def test_a_mistake_in_a_scenario_is_told_before_anything_starts(
    site: Site, tmp_path: Path, text: str, complaint: str
) -> None:
    file = tmp_path / "mistake.yaml"
    file.write_text(text)
    code, printed = site.do("run", str(file))
    assert code == 1
    assert printed.startswith(complaint.format(file=file))
    assert "\n" not in printed
    assert not site.run.exists()


def test_an_unknown_scenario_is_told_with_those_that_there_are(site: Site) -> None:
    assert site.do("run", "tango") == (1, "SCENARIO=tango is neither a file nor one of: demo, listing_5_9")


def test_an_impossible_domain_is_told(site: Site) -> None:
    site.domain = 233
    assert site.do("run", STEADY) == (1, "ROS_DOMAIN_ID=233 is not a number from 0 to 232")


def test_an_impossible_dds_configuration_is_told(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<no xml")
    code, printed = site.do("run", STEADY)
    assert code == 1
    assert printed.splitlines()[-1].startswith("Cannot join the ROS graph: ")
    assert "Traceback" not in printed
    assert not site.run.exists()


def test_a_run_directory_that_cannot_be_made_is_told(site: Site, tmp_path: Path) -> None:
    site.run = tmp_path / "file" / "run"
    site.run.parent.touch()
    assert site.do("start", STEADY) == (1, f"[Errno 20] Not a directory: '{site.run}'")
    site.run.parent.unlink()


def test_an_impossible_namespace_is_told(site: Site) -> None:
    site.namespace = "arm 1"
    code, printed = site.do("run", STEADY)
    assert code == 1
    assert printed.startswith("REACTIVE_ARM_NAMESPACE=arm 1 is no namespace such as /arm1: ")
    assert "\n" not in printed


def test_a_second_system_in_the_same_domain_is_told_and_the_first_goes_on(site: Site, tmp_path: Path) -> None:
    assert site.do("start", STEADY)[0] == 0
    before = site.members
    with closing(Site(tmp_path / "second", site.domain)) as second:
        code, printed = second.do("start", STEADY)
        assert code == 1
        assert "does not start" in printed
        assert "already runs in domain" in printed
        assert second.members == {}
    assert site.members == before


def test_a_mistake_in_a_parameter_file_is_told_before_anything_starts(site: Site, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("operator_watchdog: {ros__parameters: {silence: -1.0}}")
    complaint = f"{file}: operator_watchdog.silence: must be from 0.1 to 60, not -1.0"
    assert site.do("start", STEADY, str(file)) == (1, complaint)
    assert not site.run.exists()


def test_a_parameter_file_reaches_the_services_and_may_be_a_pipe(site: Site, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    os.mkfifo(file)
    command = site.begin("run", STEADY, str(file))
    with writer_to_a_reader_of(file, command) as writer:
        os.write(writer, b"dead_mans_switch: {ros__parameters: {pressed: true}}")
    command.await_line("Operator is alive")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_a_signal_to_make_alone_ends_everything(site: Site, number: int) -> None:
    command = site.begin_command("make", "run", f"SCENARIO={STEADY}")
    command.await_line("Engines are off")
    os.kill(command.pid, number)
    site.await_members(lambda left: not left)
    command.wait()
