from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from deploy.commands.logs import follow, readable
from deploy.supervision.run_directory import RUN, RunDirectory
from deploy.supervision.system import System


@pytest.fixture(autouse=True)
def _berlin(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TZ", "Europe/Berlin")
    time.tzset()


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        (b"[INFO] [1764274498.123456789] [velocity]: on", b"[INFO] [2025-11-27 21:14:58,123] [velocity]: on"),
        (
            b"2025-11-27 21:14:58,123 INFO spawned: 'velocity'",
            b"2025-11-27 21:14:58,123 INFO spawned: 'velocity'",
        ),
        (b"Traceback [1.5]", b"Traceback [1.5]"),
        (b"\xff", b"\xff"),
    ],
)
def test_time_of_a_line_is_readable(line: bytes, shown: bytes) -> None:
    assert readable(line) == shown


def test_lines_come_whole_and_silence_is_told(tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    log.write_bytes(b"one\ntwo\nthr")
    lines = follow(tmp_path, ["a.log"])
    assert [next(lines), next(lines), next(lines)] == [b"one", b"two", None]
    with log.open("ab") as file:
        file.write(b"ee\n")
    assert next(line for line in lines if line is not None) == b"three"
    lines.close()


def test_a_line_stands_between_two_runs(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path)
    directory.logs.mkdir()
    log = directory.logs / "velocity.log"
    log.write_text("first run\n")
    silent = directory.logs / "kinematics.log"
    silent.touch()
    directory.part_logs()
    first, between = log.read_text().splitlines()
    assert first == "first run"
    assert between.startswith(RUN)
    assert silent.read_text() == ""


def test_a_line_stands_between_two_boots_of_a_unit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    class Replaced(Exception):
        """In place of the new program of this process."""

    def execve(*command: object) -> None:
        raise Replaced

    monkeypatch.setattr(os, "execve", execve)
    monkeypatch.setattr(os, "umask", lambda mask: 0)
    monkeypatch.chdir(tmp_path)  # and back at the end
    system = System(tmp_path)
    system.logs.mkdir()
    log = system.logs / "velocity.log"
    log.write_text("first boot\n")
    with pytest.raises(Replaced):
        system.become_supervisord({}, ["--nodaemon"])
    first, between = log.read_text().splitlines()
    assert first == "first boot"
    assert between.startswith(RUN)
