"""The operator's terminal: a prompt below scrolling lines, and plain lines where it can show none."""

from __future__ import annotations

import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from deploy.operator.terminal.plain import PlainLines
from deploy.supervision.processes import ROOT

LIMIT = 20.0  # s for each awaited text
ERASE = rb"\x1b\[J"  # from the cursor on

# Shows a line every 50 ms, and each typed line in upper case, until Ctrl-D or SIGINT.
PROGRAM = """
import itertools, signal
from deploy.operator.terminal.display import open_display
signal.signal(signal.SIGTTIN, signal.SIG_IGN)
terminal = open_display(["press", "turn_off"])
try:
    for number in itertools.count():
        terminal.show([f"line {number}"])
        terminal.show(f"read {typed.upper()}" for typed in terminal.read(0.05))
except EOFError:
    terminal.show(["end of input"])
except KeyboardInterrupt:
    terminal.show(["interrupted"])
finally:
    terminal.close()
"""
# Its prompt makes room for a line, and does not come back.
STUCK_PROGRAM = f"""
import os, threading
from prompt_toolkit.renderer import Renderer
def erase(renderer):
    os.write(1, b"stuck")
    threading.Event().wait()
Renderer.erase = erase
{PROGRAM}"""
# Shows one line, and keeps another one in view, which changes when something is typed.
STATE_PROGRAM = """
from contextlib import suppress
from deploy.operator.terminal.display import open_display
terminal = open_display([])
terminal.show(["line 0"])
terminal.show_state([("good", "Engines on"), ("idle", "Released")])
with suppress(EOFError):
    while True:
        for typed in terminal.read(0.05):
            terminal.show_state([("bad", typed)])
terminal.close()
"""
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "TERM": "xterm"}


class User:
    def __init__(self, shell: str = 'exec "$@"', term: str = "xterm", program: str = PROGRAM) -> None:
        """Run a program as `"$@"` in a shell that controls the terminal."""
        self.output = b""
        self._keyboard, self.terminal = pty.openpty()
        self.modes = termios.tcgetattr(self.terminal)
        self._process = subprocess.Popen(
            ["setsid", "--ctty", "bash", "-c", shell, "bash", sys.executable, "-c", program],
            cwd=ROOT,
            env=ENVIRONMENT | {"TERM": term},
            stdin=self.terminal,
            stdout=self.terminal,
            stderr=self.terminal,
        )

    def type(self, keys: bytes) -> None:
        os.write(self._keyboard, keys)

    def await_text(self, pattern: bytes) -> None:
        """Read until a pattern appears in the output; the output until then is forgotten afterwards."""
        deadline = time.monotonic() + LIMIT
        while not (found := re.search(pattern, self.output)):
            assert time.monotonic() < deadline, f"no {pattern!r}: {self.output[-500:]!r}"
            self._read()
        self.output = self.output[found.end() :]

    def await_end(self) -> None:
        """Read until the shell ends, in order and with the terminal as it was."""
        deadline = time.monotonic() + LIMIT
        while self._process.poll() is None:
            assert time.monotonic() < deadline, self.output
            self._read()
        self._read()
        assert self._process.returncode == 0, self.output
        assert termios.tcgetattr(self.terminal) == self.modes

    def close_terminal(self) -> None:
        os.close(self._keyboard)
        self._keyboard = -1
        self._process.wait(LIMIT)

    def interrupt(self) -> None:
        self._process.send_signal(signal.SIGINT)

    def _read(self) -> None:
        if select.select([self._keyboard], [], [], 0.1)[0]:
            self.output += os.read(self._keyboard, 65536)

    def close(self) -> None:
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for descriptor in (self._keyboard, self.terminal):
            with suppress(OSError):  # it has been closed
                os.close(descriptor)


@pytest.fixture
def user(request: pytest.FixtureRequest) -> Iterator[User]:
    user = User(**getattr(request, "param", {}))
    try:
        yield user
    finally:
        user.close()


def test_typed_text_survives_the_lines_above_it(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    user.type(b"tur")
    for _ in range(3):
        user.await_text(rb"> tur[^\n]*" + ERASE + rb"[^\n]*\r\nline \d+\r\n")
    user.type(b"n_off\r")
    user.await_text(rb"read TURN_OFF\r\n")


def test_terminal_never_echoes_a_key_between_the_lines(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    for _ in range(50):
        user.await_text(rb"line \d+\r\n")
        assert not termios.tcgetattr(user.terminal)[3] & termios.ECHO


@pytest.mark.parametrize(
    ("keys", "lines"),
    [
        (b"one\rtwo\rthree\r", rb"(?s)read ONE\r\n.*read TWO\r\n.*read THREE\r\n"),
        (b"pr\t\r", rb"read PRESS\r\n"),  # Tab completes a command
    ],
)
def test_typed_lines_are_all_read(user: User, keys: bytes, lines: bytes) -> None:
    user.await_text(rb"line 0\r\n")
    user.type(keys)
    user.await_text(lines)


def test_arrow_key_repeats_a_command(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    user.type(b"twice\r")
    user.await_text(rb"read TWICE\r\n")
    user.type(b"\x1b[A\r")
    user.await_text(rb"read TWICE\r\n")


DUMB = {"term": "dumb"}


@pytest.mark.parametrize("user", [{}, DUMB], ids=["prompt", "plain"], indirect=True)
@pytest.mark.parametrize(("keys", "end"), [(b"\x04", b"end of input"), (b"a command\x03", b"interrupted")])
def test_ctrl_d_and_ctrl_c_end_the_terminal(user: User, keys: bytes, end: bytes) -> None:
    user.await_text(rb"line 0\r\n")
    user.type(keys)
    user.await_text(end + rb"\r\n")
    user.await_end()


@pytest.mark.parametrize("user", [{"shell": 'set -m; "$@"; echo stopped; fg'}], indirect=True)
def test_ctrl_z_stops_the_program_until_it_is_continued(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    user.type(b"\x1a")
    user.await_text(rb"stopped\r\n")
    user.await_text(rb"line \d+\r\n")
    user.type(b"press\r")
    user.await_text(rb"read PRESS\r\n")
    user.type(b"\x04")
    user.await_end()


@pytest.mark.parametrize("user", [{}, DUMB], ids=["prompt", "plain"], indirect=True)
def test_stopped_terminal_blocks_nothing(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    termios.tcflow(user.terminal, termios.TCOOFF)
    user.type(b"x")  # a prompt has to draw it, and waits
    user.interrupt()
    user.await_end()


def test_stopped_terminal_shows_lines_again_when_continued(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    termios.tcflow(user.terminal, termios.TCOOFF)
    user.type(b"press\r")
    termios.tcflow(user.terminal, termios.TCOON)
    user.await_text(rb"read PRESS\r\n")


@pytest.mark.parametrize("user", [DUMB], indirect=True)
def test_dumb_terminal_gets_plain_lines(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    user.type(b"press\n")
    user.await_text(rb"read PRESS\r\n")
    user.await_text(rb"line 5\r\n")
    assert b"\x1b" not in user.output


NO_HANGUP = 'trap : HUP; "$@"'  # as make, which waits for the program
IN_THE_BACKGROUND = 'set -m; "$@" & read -r; kill -INT %1; wait %1'


@pytest.mark.parametrize("user", [{"shell": IN_THE_BACKGROUND}], indirect=True)
def test_program_in_the_background_leaves_the_terminal_alone(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    assert termios.tcgetattr(user.terminal) == user.modes
    user.type(b"for the shell\n")
    user.await_text(rb"interrupted\r\n")
    user.await_end()


@pytest.mark.parametrize(
    "user",
    [{"shell": NO_HANGUP, "term": term, "program": STATE_PROGRAM} for term in ("xterm", "dumb")],
    indirect=True,
)
def test_closed_terminal_is_the_end_of_input(user: User) -> None:
    user.await_text(rb"line 0\r\n")
    user.close_terminal()


@pytest.mark.parametrize("user", [{"shell": NO_HANGUP, "program": STUCK_PROGRAM}], indirect=True)
def test_closed_terminal_is_the_end_of_input_for_a_stuck_prompt(user: User) -> None:
    user.await_text(b"stuck")
    user.close_terminal()


@pytest.mark.parametrize("redirection", ["</dev/null", "<&-"])
def test_missing_input_ends_nothing(redirection: str) -> None:
    with subprocess.Popen(
        ["sh", "-c", f'exec "$@" {redirection}', "sh", sys.executable, "-c", PROGRAM],
        cwd=ROOT,
        env=ENVIRONMENT,
        stdout=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert [process.stdout.readline() for _ in range(5)] == [b"line %d\n" % number for number in range(5)]
        process.send_signal(signal.SIGINT)
        assert process.wait(LIMIT) == 0


def test_last_line_of_a_pipe_needs_no_newline(monkeypatch: pytest.MonkeyPatch) -> None:
    reading, writing = os.pipe()
    with open(reading) as pipe:
        os.write(writing, b"press\nturn_off")
        os.close(writing)
        monkeypatch.setattr(sys, "stdin", pipe)
        terminal = PlainLines()
        assert [terminal.read(0.0) for _ in range(3)] == [["press"], ["turn_off"], []]


@pytest.mark.parametrize("user", [{"program": STATE_PROGRAM}], indirect=True)
def test_state_stays_above_the_prompt_in_colours(user: User) -> None:
    user.await_text(rb"\x1b\[0;32mEngines on\x1b\[0m \xc2\xb7 Released\x1b\[0m\r\r\n\x1b\[0m>")
    user.type(b"one\r")
    user.await_text(ERASE + rb"(\x1b\[0m)?> one")  # what was typed stays, without the state
    user.await_text(rb"\x1b\[0;31;1mone\x1b\[")
    user.type(b"\x04")
    user.await_end()


@pytest.mark.parametrize("user", [{"program": STATE_PROGRAM, "shell": 'NO_COLOR=1 exec "$@"'}], indirect=True)
def test_state_has_no_colours_where_none_are_wanted(user: User) -> None:
    user.await_text(rb"Engines on( \xc2\xb7 |\x1b\[0m \xc2\xb7 )Released")
    assert b";32m" not in user.output
    user.type(b"\x04")
    user.await_end()
