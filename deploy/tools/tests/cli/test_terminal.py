"""What others send on the terminal of a user of ``ros2``; in a pipe, everything comes as it was sent."""

from __future__ import annotations

import os
import pty
import subprocess
import sys

EVIL = "\x1b]0;PWNED\x07\x1b[2J\x9b31m\u202e\u200b"


def shown(*, on_a_terminal: bool) -> str:
    reading, writing = pty.openpty() if on_a_terminal else os.pipe()
    command = [sys.executable, "-c", "from ros2cli.cli import main; main()", "interface", "show", EVIL]
    with subprocess.Popen(command, stdout=writing, stderr=writing):
        os.close(writing)
        said = b""
        try:
            while piece := os.read(reading, 4096):
                said += piece
        except OSError:  # the terminal is closed
            pass
    os.close(reading)
    return said.decode()


def test_terminal_obeys_nothing_that_others_send() -> None:
    said = shown(on_a_terminal=True).replace("\r\n", "\n")
    assert r"\x1b]0;PWNED\x07\x1b[2J\x9b31m\u202e\u200b" in said
    assert all(each.isprintable() or each in "\n\t" for each in said)


def test_pipe_gets_everything() -> None:
    assert EVIL in shown(on_a_terminal=False)
