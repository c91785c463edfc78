"""The end of a system that a user asks for: by a signal, at a terminal, by `make stop`. No process stays."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest

from tests.system.obstacles import another_at_work, writer_to_a_reader_of
from tests.system.sites import STEADY, Site


def test_ctrl_c_at_the_terminal_of_make_run_ends_everything(site: Site) -> None:
    terminal = site.begin_in_terminal("make", "run", f"SCENARIO={STEADY}")
    terminal.await_line("Engines are off")
    members = site.members
    terminal.type("\x03\x03")
    terminal.wait()
    assert "All have ended." in terminal.output
    assert site.members == {}
    assert members.keys() == {"", *site.programs}


@pytest.mark.parametrize(
    ("moment", "number"),
    [
        ("Starting the services", signal.SIGINT),
        ("Starting the services", signal.SIGHUP),
        ("Engines are off", signal.SIGTERM),
    ],
)
def test_a_signal_ends_everything(small_site: Site, number: int, moment: str) -> None:
    command = small_site.begin("run", STEADY)
    command.await_line(moment)
    command.signal(number)
    assert command.wait() == 0
    assert "All have ended." in command.output
    assert small_site.members == {}


@pytest.mark.parametrize(
    ("target", "delay"),
    [
        *(("run", delay) for delay in (0.02, 0.2, 0.5, 1.0)),
        *(("start", delay) for delay in (0.1, 0.3, 0.8, 1.3)),
    ],
)
def test_ctrl_c_leaves_a_complete_system_or_nothing(small_site: Site, target: str, delay: float) -> None:
    command = small_site.begin_command("make", target, f"SCENARIO={STEADY}")
    time.sleep(delay)  # any moment is a good one
    command.signal(signal.SIGINT)
    command.wait()
    assert "Traceback" not in command.output
    complete = target == "start" and "It runs in the background" in command.output
    assert small_site.members.keys() == ({"", *small_site.programs} if complete else set()), command.output


def test_a_second_ctrl_c_does_not_interrupt_the_stop(small_site: Site) -> None:
    command = small_site.begin("run", STEADY)
    command.await_line("Engines are off")
    with another_at_work(small_site):
        command.signal(signal.SIGINT)
        command.await_line("Waiting for another make to end its start or stop")
        command.signal(signal.SIGINT)
    assert command.wait() == 0
    assert "All have ended." in command.output
    assert small_site.members == {}


def test_ctrl_c_before_the_start_ends_without_a_traceback(small_site: Site) -> None:
    command = small_site.begin("run", STEADY)
    while signal.SIGHUP not in caught_signals(command.pid):
        assert command.is_alive
    command.signal(signal.SIGINT)
    assert command.wait() == 0
    assert command.output == ""
    assert not small_site.run.exists()


def caught_signals(pid: int) -> set[int]:
    status = Path(f"/proc/{pid}/status").read_text()
    mask = int(status.partition("SigCgt:")[2].split()[0], 16)
    return {number for number in range(1, 65) if mask >> (number - 1) & 1}


def test_a_signal_ends_the_reading_of_a_silent_parameter_file(small_site: Site, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    os.mkfifo(file)
    command = small_site.begin("run", STEADY, str(file))
    with writer_to_a_reader_of(file, command):
        command.signal(signal.SIGINT)
        assert command.wait() == 0
    assert command.output == ""
    assert not small_site.run.exists()


@pytest.mark.parametrize("arguments", [("stop",), ("start", STEADY)], ids=lambda arguments: arguments[0])
def test_ctrl_c_ends_the_wait_for_another_start_or_stop(small_site: Site, arguments: tuple[str, ...]) -> None:
    with another_at_work(small_site):
        command = small_site.begin(*arguments)
        command.await_line("Waiting for another make to end its start or stop")
        command.signal(signal.SIGINT)
        assert command.wait() == 0
    assert len(command.lines) == 1, command.output
    assert small_site.members == {}


def test_make_stop_elsewhere_ends_terminal_and_logs(small_site: Site) -> None:
    code, printed = small_site.do("logs")
    assert code == 1
    assert printed == f"Nothing runs: make start. The logs of the last run are in {small_site.run / 'logs'}"
    log = small_site.run / "logs" / "engine_controller.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open("a") as last_run:
        last_run.write("of the last run\n")
    terminal = small_site.begin("run", STEADY)
    terminal.await_line("Engines are off")
    logs = small_site.begin("logs")
    logs.await_line("^engine_controller +of the last run$")
    logs.await_line(r"^engine_controller +-{20} \d{4}-\d\d-\d\d \d\d:\d\d:\d\d -{20}")  # between the runs
    assert small_site.do("stop")[0] == 0
    for command in (terminal, logs):
        command.await_line("The system has ended")
        assert command.wait() == 0
    assert small_site.members == {}
