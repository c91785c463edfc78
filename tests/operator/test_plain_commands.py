"""Commands that show text of others, run as the user runs them: none of it steers the terminal, or lies."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from deploy.commands import launcher
from deploy.supervision.processes import ROOT
from deploy.supervision.recorder import Recorder
from deploy.supervision.supervisord import Program
from interfaces import topics
from reactive_node.testing import MakeNode
from tests.operator.test_plain_text import CONTROLS, EVIL, LIES, is_safe
from tests.promises.history import InjectedFault, Life
from tests.promises.observations import FAULTS, PROCESSES

TEXT = f"PWNED{CONTROLS}{LIES}"  # UTF-8, as messages and MCAP have it
PID = 4242


class Arm:
    """What commands know of a running arm; its logs are full of a stranger's text. It ends soon."""

    page = None

    def __init__(self, run: Path) -> None:
        self.run, self.logs = run, run / "logs"
        self.logs.mkdir()
        (run / "supervisord.log").write_bytes(EVIL.encode(errors="surrogateescape"))
        (self.logs / "kinematics.log").write_bytes(bytes(range(256)) + f"{TEXT}\n".encode())
        self._looks = 0

    def supervisor_has_ended(self) -> bool:
        self._looks += 1
        return self._looks > 20

    def programs(self) -> list[Program]:
        return [Program("kinematics", "RUNNING", PID, 1.0, 0, TEXT, TEXT)]

    def origin(self) -> float:
        return 0.0

    def written_parameters(self) -> dict[str, Any]:
        return {}


@pytest.fixture
def stranger(make_node: MakeNode) -> Iterator[None]:
    """Reports the health of a service in words of his own, again and again."""
    topic = topics.DIAGNOSTICS
    publisher = make_node("stranger").create_publisher(topic.type, topic.name, topic.qos)
    values = [
        KeyValue(key="pid", value=str(PID)),
        KeyValue(key="published", value="1"),
        KeyValue(key=TEXT, value=TEXT),
    ]
    names = "/kinematics", f"/{TEXT}", f"/sentinel: {TEXT}"
    report = DiagnosticArray(
        status=[
            DiagnosticStatus(name=name, level=b"\1", message=TEXT, hardware_id=where, values=values)
            for name in names
            for where in (TEXT, socket.gethostname())
        ]
    )
    ended = Event()

    def publish() -> None:
        while not ended.wait(0.05):
            publisher.publish(report)

    thread = Thread(target=publish)
    thread.start()
    yield
    ended.set()
    thread.join()


@pytest.mark.parametrize(
    ("command", "shows"), [("status", True), ("terminal", True), ("logs", True), ("record", False)]
)
def test_command_shows_text_of_others_plainly(
    command: str, shows: bool, stranger: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with (
        open(os.devnull) as nothing,
        (tmp_path / "out").open("w") as out,
        (tmp_path / "err").open("w") as err,
    ):
        monkeypatch.setattr(sys, "stdin", nothing)
        monkeypatch.setattr(sys, "stdout", out)
        monkeypatch.setattr(sys, "stderr", err)
        monkeypatch.setattr(launcher, "System", lambda: Arm(tmp_path))
        monkeypatch.setattr(launcher, "_adopt_environment", lambda system: True)
        monkeypatch.setattr(launcher, "set_middleware", lambda environment: None)
        monkeypatch.setattr(launcher.interruption, "install", lambda: None)
        code = launcher.main([command])
        sys.stdout.flush()
        sys.stderr.flush()
        said = "".join((tmp_path / name).read_bytes().decode() for name in ("out", "err"))
    assert code == 0, said
    assert ("PWNED" in said) == shows, said
    assert is_safe(said), said


@pytest.fixture
def record(tmp_path: Path) -> Path:
    """A record of a run of chaos in which each text is a stranger's."""
    path = tmp_path / "record.mcap"
    recorder = Recorder(path, 0, 10**18)
    fault = InjectedFault(TEXT, TEXT, 5.0, 6.0)
    recorder.event(PROCESSES, 1, Life(TEXT, 7, 0.0, None)._asdict() | {"namespace": "/"})
    recorder.event(FAULTS, 5 * 10**9, fault._asdict() | {"namespace": "/"})
    for topic in (topics.ENGINES, topics.ENGINES_STATE):
        for second in range(1, 20):
            data = serialize_message(String(data=TEXT))
            recorder.message(topic.full_name("/"), topic.type_name, "", data, second * 10**9, second * 10**9)
    recorder.close()
    return path


@pytest.mark.parametrize("command", [["tests.replay"], ["tests.chaos", "--replay"]])
def test_report_on_a_record_of_others_is_plain(command: list[str], record: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", *command, str(record)],
        cwd=ROOT,
        env={**os.environ, "RUNTIME": ""},
        capture_output=True,
        timeout=120,
    )
    said = (done.stdout + done.stderr).decode()
    assert "Traceback" not in said
    assert said
    assert is_safe(said), said
    for written in (*record.parent.glob("*.html"), *record.parent.glob("*.svg")):
        text = written.read_text(encoding="utf-8")
        assert "PWNED" in text or written.suffix == ".svg"
        assert is_safe(text), written
