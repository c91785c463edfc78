"""Logs of supervisord that drop lines instead of raising, and the state of its programs."""

from __future__ import annotations

import importlib.metadata
import json
import os
import pkgutil
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from supervisor import events, loggers
from supervisor.poller import Poller
from supervisor.states import ProcessStates

from deploy.supervision import extension, manifest
from deploy.supervision.extension import LONGEST_WAIT, ArmInterface, LossyLog, make_interface

LIMIT = 10  # bytes of a log until it is rolled over


def log_to(file: Path) -> closing[loggers.Logger]:
    return closing(loggers.Logger(handlers=[LossyLog(str(file), "a", LIMIT, 1)]))


@contextmanager
def own_signals() -> Iterator[None]:
    before = signal.set_wakeup_fd(-1)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)


def interface_of(poller: Any, **processes: Any) -> ArmInterface:
    options = SimpleNamespace(poller=poller)
    group = SimpleNamespace(processes=processes)
    return ArmInterface(SimpleNamespace(options=options, process_groups={"arm": group}))


def in_state(state: int) -> SimpleNamespace:
    return SimpleNamespace(get_state=lambda: state)


def interface_with(name: str = "velocity", **fields: Any) -> tuple[ArmInterface, SimpleNamespace]:
    """Return an interface, and the process of its program."""
    process = in_state(ProcessStates.RUNNING)
    vars(process).update(config=SimpleNamespace(name=name), pid=1000, spawnerr=None, backoff=0, **fields)
    return interface_of(SimpleNamespace(poll=lambda timeout: ([], [])), **{name: process}), process


def test_supervisor_is_the_one_whose_names_are_replaced() -> None:
    words = "another supervisor: read what it does with the names in REPLACED, then set VERSION"
    assert importlib.metadata.version("supervisor") == extension.VERSION, words
    for name in extension.REPLACED:
        assert callable(pkgutil.resolve_name(name))


def test_a_full_disk_costs_only_the_lines_meanwhile(tmp_path: Path) -> None:
    file = tmp_path / "velocity.log"
    file.symlink_to("/dev/full")
    with log_to(file) as log:
        for _ in range(3):
            log.info(b"too long a line\n")  # it cannot be written, nor the file be closed for another one
        file.unlink()
        log.info(b"short\n")
    assert file.read_bytes() == b"short\n"


def test_a_log_that_cannot_be_rolled_over_goes_on(tmp_path: Path) -> None:
    file, obstacle = tmp_path / "velocity.log", tmp_path / "velocity.log.1"
    with log_to(file) as log:
        obstacle.mkdir()
        log.info(b"too long a line\n")
        obstacle.rmdir()
        log.info(b"short\n")
    assert obstacle.read_bytes() == b"too long a line\nshort\n"


def test_a_log_that_cannot_be_opened_is_opened_later(tmp_path: Path) -> None:
    directory = tmp_path / "logs"
    directory.touch()
    file = directory / "velocity.log"
    with log_to(file) as log:
        log.info(b"lost\n")
        directory.unlink()
        log.info(b"short\n")
    assert file.read_bytes() == b"short\n"


def test_an_existing_log_is_continued_and_rolled_over(tmp_path: Path) -> None:
    file = tmp_path / "velocity.log"
    file.write_bytes(b"first\n")
    with log_to(file) as log:
        log.info(b"second\n")
        log.info(b"third\n")
    assert (tmp_path / "velocity.log.1").read_bytes() == b"first\nsecond\n"
    assert file.read_bytes() == b"third\n"


def test_supervisord_uses_it_from_then_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # supervisord locks its directory; a set-up waits for a lock of the checkout
    monkeypatch.setattr(loggers, "RotatingFileHandler", loggers.RotatingFileHandler)  # restored at the end
    monkeypatch.setattr(events, "callbacks", [])
    file = tmp_path / "supervisord.log"
    with closing(loggers.Logger()) as own, closing(loggers.Logger()) as program, own_signals():
        loggers.handle_file(own, str(file), "%(message)s", True, LIMIT, 1)
        make_interface(SimpleNamespace(options=SimpleNamespace(logger=own, poller=Poller(None))))
        (tmp_path / "supervisord.log.1").mkdir()
        own.info(b"too long a line\n")
        own.info(b"short\n")
        loggers.handle_file(program, "/dev/null/velocity.log", "%(message)s", True, LIMIT, 1)
    assert file.read_bytes() == b"too long a line\nshort\n"


def test_setting_the_clock_changes_no_uptime(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "callbacks", [])
    arm, velocity = interface_with(laststart=time.time())
    events.notify(events.ProcessStateStartingEvent(velocity, ProcessStates.STOPPED))
    real = time.time

    for hours in (1, -1):
        monkeypatch.setattr(time, "time", lambda hours=hours: real() + hours * 3600)
        (state,) = json.loads(arm.programs())
        assert 0.0 < state["uptime"] < 60.0


def test_reports_how_long_a_program_had_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "callbacks", [])
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    arm, velocity = interface_with(exitstatus=-1)

    def notify(at: float, event: Any) -> tuple[int, float]:
        now[0] = at
        events.notify(event)
        (state,) = json.loads(arm.programs())
        return state["restarts"], round(state["away"], 3)

    starts = events.ProcessStateStartingEvent(velocity, ProcessStates.STOPPED)
    exits = events.ProcessStateExitedEvent(velocity, ProcessStates.RUNNING)
    assert notify(100.0, starts) == (0, 0.0)
    assert notify(105.0, exits) == (0, 0.0)
    assert notify(105.2, starts) == (1, 0.2)


def test_pause_of_supervisord_is_no_silence_of_the_sentinel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "callbacks", [])
    now, killed = [100.0], []
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(os, "kill", lambda *given: killed.append(given))
    arm, sentinel = interface_with(manifest.sentinel())
    events.notify(events.ProcessStateStartingEvent(sentinel, ProcessStates.STOPPED))

    def poll(passed: float) -> list[Any]:
        now[0] += passed
        arm._poller.poll(1.0)
        return killed

    arm.watch()
    assert [len(poll(passed)) for passed in (60.0, 1.0, 1.0, 1.0)] == [0, 0, 0, 0]
    assert poll(1.0) == [(sentinel.pid, signal.SIGKILL)]


@pytest.mark.parametrize("state", [ProcessStates.STARTING, ProcessStates.BACKOFF, ProcessStates.STOPPING])
def test_supervisord_sleeps_unless_a_program_changes(state: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "callbacks", [])
    waits: list[float] = []

    def poll(timeout: float) -> tuple[list[int], list[int]]:
        waits.append(timeout)
        return [], []

    settled, changing = SimpleNamespace(poll=poll), SimpleNamespace(poll=poll)
    interface_of(settled, a=in_state(ProcessStates.RUNNING), b=in_state(ProcessStates.FATAL))
    interface_of(changing, a=in_state(ProcessStates.RUNNING), b=in_state(state))
    settled.poll(1.0)
    changing.poll(1.0)
    assert waits == [1.0, LONGEST_WAIT]


def test_signal_wakes_supervisord(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(events, "callbacks", [])
    poller = Poller(None)
    killed = threading.Timer(0.1, os.kill, (os.getpid(), signal.SIGUSR2))
    before = signal.signal(signal.SIGUSR2, lambda number, frame: None)
    try:
        with own_signals():
            interface_of(poller).wake_at_signals()
            killed.start()
            began = time.monotonic()
            assert poller.poll(30.0) == ([], [])
            assert time.monotonic() - began < 10.0
    finally:
        killed.join()
        signal.signal(signal.SIGUSR2, before)
