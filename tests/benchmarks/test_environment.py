"""The environment of the alternatives: each run installs what it needs, once."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.benchmarks import environment
from deploy.benchmarks.environment import EnvironmentFailed


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """What was done since the last look; `refused.txt` cannot be installed."""
    done: list[str] = []

    def run(command: list[str]) -> None:
        done.append("venv" if "venv" in command else Path(command[-1]).name)
        if done[-1] == "refused.txt":
            raise EnvironmentFailed("no matching distribution")

    monkeypatch.setattr(environment, "_run", run)
    monkeypatch.setattr(environment, "_STAMP", tmp_path / "made-from")
    return done


def test_each_file_is_installed_when_a_run_first_needs_it(installed: list[str]) -> None:
    environment.prepare(["chart.txt"])
    assert installed == ["venv", "system.txt", "embedded.txt", "chart.txt"]
    installed.clear()

    environment.prepare(["chart.txt"])
    assert installed == []

    environment.prepare(["chart.txt", "zenoh.txt"])
    assert installed == ["zenoh.txt"]


def test_refused_file_is_tried_again(installed: list[str]) -> None:
    for _ in range(2):
        refused = environment.prepare(["refused.txt"])
        assert refused == {"refused.txt": "no matching distribution"}
    assert installed == ["venv", "system.txt", "embedded.txt", "refused.txt", "refused.txt"]


def test_other_python_makes_the_environment_anew(
    installed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    environment.prepare([])
    installed.clear()
    monkeypatch.setattr(environment.sys, "version", "4.0")

    environment.prepare([])

    assert installed == ["venv", "system.txt", "embedded.txt"]
