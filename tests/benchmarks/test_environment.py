"""The environment of the embedded rclpy is made once, and again when Python has changed."""

from __future__ import annotations

from pathlib import Path

import pytest

from deploy.benchmarks import environment
from deploy.benchmarks.environment import EnvironmentFailed


def test_other_python_makes_the_environment_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    commands: list[str] = []
    monkeypatch.setattr(environment, "_run", lambda command: commands.append(command[2]))
    monkeypatch.setattr(environment, "_STAMP", tmp_path / "made-from")

    environment.prepare()
    environment.prepare()
    assert commands == ["venv", "-m"]

    monkeypatch.setattr(environment.sys, "version", "4.0")
    environment.prepare()
    assert commands == ["venv", "-m"] * 2


def test_refused_environment_is_tried_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(command: list[str]) -> None:
        raise EnvironmentFailed("no matching distribution")

    monkeypatch.setattr(environment, "_run", refuse)
    monkeypatch.setattr(environment, "_STAMP", tmp_path / "made-from")

    for _ in range(2):
        with pytest.raises(EnvironmentFailed):
            environment.prepare()
