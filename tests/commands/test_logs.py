from __future__ import annotations

import itertools
import os
import time
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import pytest

from deploy.commands.logs import Line, follow, readable
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
    assert readable(Line(0.0, "velocity", line)) == b"velocity           " + shown


def texts(lines: Iterable[Line | None]) -> list[bytes]:
    """Return the texts until nothing is new."""
    return [line.text for line in itertools.takewhile(lambda line: line is not None, lines) if line]


def test_lines_come_whole_and_silence_is_reported(tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    log.write_bytes(b"one\ntwo\nthr")
    with closing(follow([log])) as lines:
        assert texts(lines) == [b"one", b"two"]
        with log.open("ab") as file:
            file.write(b"ee\n")
        assert texts(lines) == [b"three"]


def test_lines_of_all_files_are_in_the_order_of_their_times(tmp_path: Path) -> None:
    first, second = tmp_path / "first.log", tmp_path / "second.log"
    first.write_bytes(
        b"[INFO] [1764274498.100] [first]: one\n[ERROR] [1764274500.100] [first]: four\nTrace\n"
    )
    second.write_bytes(b"2025-11-27 21:14:59,000 INFO two\n[INFO] [1764274499.500] [second]: three\n")
    (tmp_path / "third.log").write_bytes(b"-------------------- 2025-11-27 21:14:57 --------------------\n")
    with closing(follow([first, second, tmp_path / "third.log"])) as lines:
        shown = [line.split()[-1] for line in texts(lines)]
    assert shown == [b"-" * 20, b"one", b"two", b"three", b"four", b"Trace"]


def test_only_the_latest_lines_of_a_file_are_shown(tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    log.write_bytes(b"".join(b"%d %s\n" % (n, b"x" * 100) for n in range(2000)))
    with closing(follow([log])) as lines:
        assert [int(text.split()[0]) for text in texts(lines)] == [*range(1990, 2000)]


def test_file_that_is_replaced_or_emptied_is_followed(tmp_path: Path) -> None:
    log = tmp_path / "a.log"
    log.write_bytes(b"one\n")
    with closing(follow([log])) as lines:
        assert texts(lines) == [b"one"]
        with log.open("ab") as file:
            file.write(b"two\n")
        log.rename(tmp_path / "a.log.1")
        log.write_bytes(b"three\n")
        assert texts(lines) == [b"two", b"three"]
        log.write_bytes(b"4\n")
        assert texts(lines) == [b"4"]


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
    system.remove_settings()
    first, between = log.read_text().splitlines()
    assert first == "first boot"
    assert between.startswith(RUN)
