"""An arm whose unit systemd starts: by a service manager of the test's own."""

from __future__ import annotations

import os
import signal
import socket
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.sites import LIMIT, STEADY, Command, Site
from tests.system.systemd import command_of, environment_of


class Systemd:
    """Starts a unit, and hears its notifications."""

    def __init__(self, site: Site, unit: str, address: Path) -> None:
        self._site = site
        self._command = command_of(unit)
        self._environment = environment_of(unit)
        self._address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(address))

    def start(self) -> Command:
        """Start the command of the unit, which has nothing but what the unit gives it."""
        basic = {name: os.environ[name] for name in ("HOME", "PATH", "REACTIVE_ARM_TESTS")}
        return self._site.begin_alone(
            self._command, basic | self._environment | {"NOTIFY_SOCKET": str(self._address)}
        )

    def await_word(self, word: str) -> None:
        """Wait until the unit notifies this, from now on."""
        self._socket.setblocking(False)
        try:
            while True:
                self._socket.recv(100)
        except BlockingIOError:
            pass
        deadline = time.monotonic() + LIMIT
        heard = ""
        while heard != word:
            self._socket.settimeout(max(0.01, deadline - time.monotonic()))
            heard = self._socket.recv(100).decode()

    def close(self) -> None:
        self._socket.close()


@pytest.fixture
def systemd(small_site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Systemd]:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))
    code, printed = small_site.do("unit", STEADY)
    path = tmp_path / "config" / "systemd" / "user" / "reactive-arm.service"
    assert code == 0, printed
    assert printed == (
        f"Wrote {path}. Start it now and at each boot: systemctl --user daemon-reload"
        " && systemctl --user enable --now reactive-arm && loginctl enable-linger"
    )
    systemd = Systemd(small_site, path.read_text(), tmp_path / "notify")
    yield systemd
    systemd.close()


def test_a_unit_is_ready_alive_killed_started_again_and_stopped(small_site: Site, systemd: Systemd) -> None:
    first = systemd.start()
    systemd.await_word("READY=1")
    before = small_site.members
    assert before.keys() == {"", *small_site.programs}
    assert before[""] == first.pid
    systemd.await_word("WATCHDOG=1")

    os.kill(small_site.members["sentinel"], signal.SIGKILL)
    systemd.await_word("WATCHDOG=1")  # of the next sentinel
    before = small_site.members

    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    assert small_site.members.keys() == small_site.programs  # orphans
    second = systemd.start()
    systemd.await_word("READY=1")
    after = small_site.members
    assert after.keys() == before.keys()
    assert set(after.values()).isdisjoint(before.values())
    assert small_site.do("status")[0] == 0

    os.kill(second.pid, signal.SIGTERM)  # to the main process only: KillMode=mixed
    assert second.wait() == 0, second.output
    assert "Traceback" not in second.output
    assert small_site.members == {}


def test_mistakes_are_refused_before_a_unit_is_written(
    small_site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    code, printed = small_site.do("unit", "nonsense")
    assert (code, printed.partition(" is ")[0]) == (1, "SCENARIO=nonsense")
    assert not (tmp_path / "systemd").exists()
