from __future__ import annotations

import os
import pty
import select
import shutil
import subprocess
import sys
import threading
from contextlib import suppress
from typing import Any

import pytest

from deploy.operator import output
from deploy.operator.output import Area, say
from deploy.supervision.processes import ROOT

LINES = 5000  # of 100 characters, more than a pipe holds
FLOOD = f"from deploy.operator.output import say\nfor _ in range({LINES}): say('#' * 99)"


def test_reader_that_does_not_read_blocks_nothing() -> None:
    with subprocess.Popen([sys.executable, "-c", FLOOD], cwd=ROOT, stdout=subprocess.PIPE) as process:
        try:
            assert process.wait(30) == 0
        finally:
            process.kill()
        assert process.stdout is not None
        lines = process.stdout.read().splitlines()
    assert 0 < len(lines) < LINES
    assert set(lines) == {b"#" * 99}


def test_reader_that_is_late_for_a_moment_gets_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    with open(reading, "rb") as reader, open(writing, "w") as pipe:
        with suppress(BlockingIOError):
            while True:
                os.write(writing, b"#" * 4096)
        waits, wait = threading.Event(), select.select

        def noted(*arguments: Any) -> Any:
            waits.set()
            return wait(*arguments)

        def read() -> None:
            waits.wait()
            while b"late" not in reader.read1():
                pass

        monkeypatch.setattr(output, "_patience", 60.0)
        monkeypatch.setattr(select, "select", noted)
        monkeypatch.setattr(sys, "stdout", pipe)
        late = threading.Thread(target=read, daemon=True)
        late.start()
        say("late")
        late.join(60.0)
        assert not late.is_alive(), "the line was dropped"


def test_closed_standard_output_gets_nothing() -> None:
    command = f'exec "{sys.executable}" -c "from deploy.operator.output import say; say(0)" >&-'
    done = subprocess.run(["sh", "-c", command], cwd=ROOT, stderr=subprocess.PIPE)
    assert (done.returncode, done.stderr) == (0, b"")


def test_pipe_without_reader_is_an_error() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", FLOOD], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        assert process.stdout is not None
        process.stdout.close()
        assert process.stderr is not None
        assert b"BrokenPipeError" in process.stderr.read()


def test_area_is_drawn_again_in_place_in_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    keyboard, terminal = pty.openpty()
    monkeypatch.setattr(shutil, "get_terminal_size", lambda *_, **__: os.terminal_size((9, 24)))
    with os.fdopen(keyboard, "rb", buffering=0) as shown, os.fdopen(terminal, "w") as output:
        monkeypatch.setattr(sys, "stdout", output)
        area = Area()
        area.show("one\ntwo, which is long")
        area.show("three")
        read = b""
        while b"three" not in read:
            read += shown.read(100)
        assert read == b"one\r\ntwo, whi\r\n\x1b[2A\x1b[Jthree\r\n"


def test_area_of_a_file_is_appended(capfd: pytest.CaptureFixture[str]) -> None:
    area = Area()
    area.show("one")
    area.show("two")
    assert capfd.readouterr().out == "one\n\ntwo\n"
