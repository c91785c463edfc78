"""An arm writes nothing outside of its run directory, and needs no home."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from deploy.supervision.run_directory import RunDirectory
from tests.system.sites import Site

SERVICE = "engine_controller"


@pytest.mark.parametrize("home", ["unset", "empty", "missing", "/proc"])
def test_arm_needs_no_home(small_site: Site, monkeypatch: pytest.MonkeyPatch, home: str) -> None:
    monkeypatch.delenv("HOME", raising=False)
    if home != "unset":
        monkeypatch.setenv("HOME", {"empty": ""}.get(home, home))
    monkeypatch.chdir("/")
    code, words = small_site.do("start", "none")
    assert code == 0, words
    assert "rcutils" not in words
    assert small_site.do("status")[0] == 0
    assert small_site.do("stop")[0] == 0
    logs = [path.read_text() for path in RunDirectory(small_site.run).logs.glob("*.log")]
    assert logs
    assert not [text for text in logs if "rcutils" in text or "log_dir" in text]


def test_nothing_is_written_into_the_home(
    small_site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    assert small_site.do("start", "none")[0] == 0
    killed = small_site.members[SERVICE]
    os.kill(killed, signal.SIGKILL)
    small_site.await_members(lambda members: members.get(SERVICE, killed) != killed)
    small_site.do("status")
    small_site.do("stop")
    assert [*home.rglob("*")] == []
