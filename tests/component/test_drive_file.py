"""The file of a drive gets each order, whatever kind of file it is, or the reason is one line."""

from __future__ import annotations

import os
import pty
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from interfaces.drive_file import DriveFile
from interfaces.service import UserError


@pytest.fixture
def pipe(tmp_path: Path) -> Path:
    path = tmp_path / "relay"
    os.mkfifo(path)
    return path


@pytest.fixture
def reader(pipe: Path) -> Iterator[int]:
    file = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    yield file
    os.close(file)


def uses(path: Path | str) -> int:
    """How many files of this process are open at a path."""
    files = (each for each in Path("/proc/self/fd").iterdir() if each.is_symlink())
    return [os.path.realpath(each) for each in files].count(str(path))


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    """The driver's end of a serial line, and the path of ours."""
    driver, ours = pty.openpty()
    yield driver, os.ttyname(ours)
    os.close(driver)
    os.close(ours)


def test_regular_file_has_the_last_order(tmp_path: Path) -> None:
    pin = tmp_path / "value"
    pin.write_text("0\n")
    file = DriveFile(str(pin))
    for on in (True, True, False, True):
        file.write(on)
        assert pin.read_text() == f"{on:d}\n"


def test_serial_line_gets_each_order_and_stays_open(line: tuple[int, str]) -> None:
    driver, path = line
    file = DriveFile(path)
    for on in (False, True):
        file.write(on)
        assert os.read(driver, 9).strip() == f"{on:d}".encode()
    assert uses(path) == 2  # its own and that of the fixture


def test_serial_line_does_not_become_the_terminal_of_its_process(line: tuple[int, str]) -> None:
    write = "from interfaces.drive_file import DriveFile; DriveFile(sys.argv[1]).write(False)"
    code = f"import os, sys; {write}; os.open('/dev/tty', os.O_RDONLY)"
    program = [sys.executable, "-c", code, line[1]]
    ended = subprocess.run(program, start_new_session=True, capture_output=True, text=True)
    assert ended.stderr.strip().endswith("No such device or address: '/dev/tty'")


def test_pipe_gets_each_order(pipe: Path, reader: int) -> None:
    file = DriveFile(str(pipe))
    for on in (False, True):
        file.write(on)
    assert os.read(reader, 9) == b"0\n1\n"


def test_order_does_not_wait_in_a_pipe_for_longer_than_it_counts(pipe: Path, reader: int) -> None:
    file = DriveFile(str(pipe))
    for _ in range(4):
        file.write(True)
    with pytest.raises(UserError, match=f"^file: {pipe} cannot be written: its reader does not read$"):
        file.write(True)
    assert uses(pipe) == 1  # that of its reader: a line that has failed is opened again
    assert os.read(reader, 99) == b"1\n" * 4
    file.write(False)
    assert os.read(reader, 99) == b"0\n"


def test_pipe_that_nobody_reads_is_reported_and_used_again(pipe: Path) -> None:
    file = DriveFile(str(pipe))
    for _ in range(2):
        with pytest.raises(UserError, match="nobody reads it"):
            file.write(False)
        reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
        file.write(False)
        os.close(reader)


def test_file_that_was_replaced_gets_the_orders(tmp_path: Path) -> None:
    pin, other = tmp_path / "value", tmp_path / "other"
    pin.write_text("0\n")
    other.write_text("0\n")
    file = DriveFile(str(pin))
    file.write(True)
    other.rename(pin)
    file.write(True)
    assert pin.read_text() == "1\n"
    pin.unlink()
    with pytest.raises(UserError, match="No such file or directory"):
        file.write(False)
    pin.write_text("1\n")
    file.write(False)
    assert pin.read_text() == "0\n"


def test_file_that_was_replaced_does_not_stay_open(tmp_path: Path) -> None:
    pin, other = tmp_path / "value", tmp_path / "other"
    pin.write_text("0\n")
    file = DriveFile(str(pin))
    file.write(True)
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(5):
        other.write_text("0\n")
        other.rename(pin)
        file.write(True)
    assert len(os.listdir("/proc/self/fd")) == before


@pytest.mark.parametrize(
    ("kind", "reason"),
    [("folder", "Is a directory"), ("socket", "nobody reads it"), ("/dev/full", "No space left on device")],
)
def test_other_file_is_refused_in_one_line(tmp_path: Path, kind: str, reason: str) -> None:
    path = kind if kind.startswith("/") else str(tmp_path / kind)
    if kind == "folder":
        os.mkdir(path)
    with socket.socket(socket.AF_UNIX) as unix:
        if kind == "socket":
            unix.bind(path)
        with pytest.raises(UserError, match=f"^file: {path} cannot be written: {reason}$"):
            DriveFile(path).write(False)
