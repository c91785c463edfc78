"""Text of others on the user's terminal, in log files and on the page: shown, never obeyed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import pytest
from supervisor.loggers import LevelsByName, LogRecord

from deploy.commands.hosts import Hosts
from deploy.commands.status import of_services
from deploy.operator import output
from deploy.operator.fleet import Arm as FleetArm
from deploy.operator.fleet import row
from deploy.operator.lines import FIRST, Kind, Line
from deploy.operator.page import state
from deploy.operator.terminal.terminal import Terminal
from deploy.supervision.columns import table
from deploy.supervision.extension import LossyLog
from deploy.supervision.processes import ROOT
from deploy.supervision.supervisord import Program
from interfaces.plain_text import LONGEST, PlainBytes, plain, plain_lines
from interfaces.service.clocks import Clocks
from interfaces.service.health import Health
from tests.operator.page.clients import Arm, update

CONTROLS = "".join(chr(code) for code in (*range(1, 32), *range(127, 160)))
LIES = "\u061c\u200b\u200e\u202a\u202e\u2028\u2029\u2060\u2066\u2069\ufeff\u00ad\u3164\U000e0041"
EVIL = f"\x1b]0;PWNED\x07\x1b[2J{CONTROLS}{LIES}\udc9bEngines are off"
ARGUMENT = EVIL.translate(dict.fromkeys(map(ord, "\n\t\udc9b")))


def is_safe(text: str) -> bool:
    return all(each.isprintable() or each in "\n\t" for each in text) and not set(LIES) & set(text)


def test_every_character_is_shown_or_escaped() -> None:
    for code in range(sys.maxunicode + 1):
        shown = plain(chr(code))
        assert shown.isprintable()
        assert plain_lines(chr(code)).strip("\n\t").isprintable()
        assert shown.encode() is not None, "it is no lone surrogate"
    assert plain("θ₁ → 日本 ä 👍") == "θ₁ → 日本 ä 👍"
    assert plain("a\nb\x1b[0m\x9b\udc9b") == r"a\nb\x1b[0m\x9b\udc9b"
    assert plain_lines("a\tb\nc\r\n") == "a\tb\nc\\r\n"
    assert plain("\u202eon\u00a0") == "\\u202eon "


def test_long_text_is_cut() -> None:
    assert plain("x" * 10_000) == "x" * LONGEST + "…"


def test_bytes_are_decoded_across_pieces() -> None:
    of_program = PlainBytes()
    pieces = [of_program(piece) for piece in (b"\xce", b"\xb8\xff\xc2", b"\x9b31m\x1b[\n")]
    assert b"".join(pieces).decode() == "θ\\xff\\x9b31m\\x1b[\n"


@pytest.mark.parametrize(
    "text",
    [
        lambda: of_services([Program("x", "RUNNING", 7, 1.0, 0, "", "")], {("here", "x"): health()}),
        lambda: table([("a", EVIL)]),
        lambda: table([row(fleet_arm(), 0.0)]),
        lambda: hosts(),
    ],
    ids=["status", "table", "fleet", "clocks"],
)
def test_tables_are_plain(text: Callable[[], str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("socket.gethostname", lambda: "here")
    shown = text()
    assert r"\x1b]0;PWNED\x07" in shown
    assert is_safe(shown)


def health() -> Health:
    return Health(time.monotonic(), 7, False, EVIL, None, "here")


def fleet_arm() -> FleetArm:
    return FleetArm("/", 0, healths={("here", "x"): health()._replace(heard=0.0)})


def hosts() -> str:
    with mock.patch.object(Clocks, "differences", return_value={EVIL: 0.5}):
        return Hosts("/").clocks()


def test_lines_of_the_terminal_are_plain() -> None:
    shown: list[str] = []
    display = SimpleNamespace(show=lambda lines: shown.extend(lines))
    terminal: Any = SimpleNamespace(_display=display, _milliseconds=lambda _: 0.0)
    Terminal._show(terminal, [Line(FIRST, Kind.SERVICE, EVIL)])
    assert shown[0].startswith(r"[0] \x1b]0;PWNED\x07")
    assert "\n" not in shown[0]
    assert is_safe(shown[0])


def test_line_above_the_prompt_is_plain(capfd: pytest.CaptureFixture[str]) -> None:
    output.say(EVIL)
    assert is_safe(capfd.readouterr().out)


COMMANDS = {
    "status": ("deploy.commands.launcher", "status", "{evil}"),
    "start": ("deploy.commands.launcher", "start", "{evil}"),
    "start, file": ("deploy.commands.launcher", "start", "none", "{evil}"),
    "fleet": ("deploy.commands.fleet", "{evil}"),
    "replay": ("tests.replay", "{evil}"),
    "chaos, record": ("tests.chaos", "--replay", "{evil}"),
    "chaos": ("tests.chaos", "--schedule", "{evil}"),
    "simulate": ("tests.simulation", "--schedule", "{evil}"),
    "new-service": ("deploy.commands.new_service", "{evil}"),
    "service": ("services.kinematics", "--ros-args", "-p", "x:={evil}"),
    "service, file": ("services.kinematics", "--ros-args", "--params-file", "{evil}"),
}


@pytest.mark.parametrize("command", COMMANDS)
def test_errors_are_plain(command: str) -> None:
    module, *words = (word.format(evil=ARGUMENT) for word in COMMANDS[command])
    done = subprocess.run(
        [sys.executable, "-m", module, *words],
        cwd=ROOT,
        env={**os.environ, "MANIFEST": "", "ROS_DOMAIN_ID": "40"},
        capture_output=True,
        timeout=120,
    )
    assert done.returncode not in (0, -9)
    said = (done.stdout + done.stderr).decode()
    assert "PWNED" in said
    assert is_safe(said), said


def test_argument_that_is_no_text_is_one_line() -> None:
    command = [sys.executable, "-m", "services.kinematics", "--ros-args", "-p", "x:=\udc9b"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=120)
    assert done.returncode == 2
    assert re.fullmatch(rb"kinematics: [^\n]*\n", done.stderr)


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_everything_that_a_command_prints_is_plain(stream: str) -> None:
    program = (
        "import sys; from deploy.operator.output import use_plain_output; use_plain_output();"
        f"print({EVIL!r}, file=sys.{stream}); raise RuntimeError({EVIL!r})"
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True)
    assert is_safe(getattr(done, stream).decode())
    assert is_safe(done.stderr.decode())


def test_log_files_are_plain(tmp_path: Path) -> None:
    log = LossyLog(str(tmp_path / "kinematics.log"))
    log.setFormat("%(message)s")
    for piece in (EVIL.encode("utf-8", "surrogatepass"), bytes(range(256)), b"\n"):
        log.emit(LogRecord(LevelsByName.INFO, piece))
    log.close()
    written = (tmp_path / "kinematics.log").read_bytes().decode()
    assert r"\x1b]0;PWNED\x07" in written
    assert is_safe(written)


def test_page_gets_plain_texts(tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("")
    arm = Arm(tmp_path)
    arm.state = state.PageState(programs={("here", "kinematics"): state.Program(reason=EVIL, heard=1e9)})
    try:
        with arm.page() as page:
            texts = [each["health"] for each in update(page)["processes"] if each["name"] == "kinematics"]
    finally:
        arm.close()
    assert texts[0].startswith(r"\x1b]0;PWNED\x07")
    assert is_safe(texts[0])
