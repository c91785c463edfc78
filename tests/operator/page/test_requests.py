from __future__ import annotations

import signal
import socket
from functools import reduce
from pathlib import Path
from typing import Any

import pytest
import reactivex as rx

from deploy.operator.page import protocol, requests
from deploy.operator.page.protocol import Process
from deploy.operator.page.server import Request
from deploy.operator.page.state import Change, PageState, Program
from deploy.supervision import processes

KILL = Request("page", Process("velocity", "kill"), is_local=True)
PROGRAMS = {
    ("desk", "velocity"): Program(pid=8),
    (socket.gethostname(), "velocity"): Program(pid=7),
}


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Any]:
    signals: list[Any] = []

    def send_signal(*arguments: Any) -> bool:
        signals.append(arguments)
        return True

    monkeypatch.setattr(processes, "send_signal", send_signal)
    monkeypatch.setenv(processes.MARK, str(tmp_path))
    return signals


def refusals(request: Request, programs: dict[tuple[str, str], Program]) -> list[tuple[str, str, str]]:
    changes: list[Change] = []
    requests.send_signal(request, programs).subscribe(changes.append)
    return list(reduce(lambda state, change: change(state), changes, PageState()).refusals.items)


def test_each_error_of_pages_is_told_once() -> None:
    texts = ["a", "b", "a", *map(str, range(100))]
    asked = rx.of(*(Request("page", protocol.Fault(text), True) for text in texts))
    reported: list[str] = []
    requests.faults(asked).subscribe(reported.append)
    assert reported == ["a", "b", *map(str, range(requests.MOST_FAULTS - 2))]


@pytest.mark.parametrize(("action", "number"), [("kill", signal.SIGKILL), ("stop", signal.SIGSTOP)])
def test_page_on_the_machine_may_end_or_stop_a_process(
    sent: list[Any], tmp_path: Path, action: str, number: int
) -> None:
    assert refusals(KILL._replace(message=Process("velocity", action)), PROGRAMS) == []
    assert sent == [(tmp_path, "velocity", 7, number)]


def test_page_elsewhere_may_not(sent: list[Any]) -> None:
    reason = "only pages on the machine of the arm may do this"
    assert refusals(KILL._replace(is_local=False), PROGRAMS) == [("page", "process", reason)]
    assert sent == []


def test_without_supervisord_there_is_nothing_to_kill(
    sent: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(processes.MARK)
    assert len(refusals(KILL, PROGRAMS)) == 1
    assert sent == []


def test_process_that_has_ended_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(processes.MARK, str(tmp_path))
    assert refusals(KILL, {}) == [("page", "process", "velocity has no process on this host now")]
