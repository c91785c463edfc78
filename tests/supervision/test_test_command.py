"""`make test`: runs of pytest, of which the later ones have the tests with bounds of time."""

from __future__ import annotations

import subprocess

import pytest

from deploy.commands import test as command


@pytest.mark.parametrize(
    ("codes", "result"),
    [([5, 5, 5], 5), ([0, 5, 5], 0), ([5, 0, 5], 0), ([1, 0, 0], 1), ([0, 5, 1], 1), ([2], 2), ([0, 3], 3)],
)
def test_exit_code_is_the_worst_and_an_interruption_ends_it(
    monkeypatch: pytest.MonkeyPatch, codes: list[int], result: int
) -> None:
    left = list(codes)
    monkeypatch.setattr(subprocess, "call", lambda command, env: left.pop(0))
    assert command.main(["tests"]) == result
    assert left == []


def test_every_test_runs_once_and_those_with_bounds_of_time_beside_few(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "call", lambda command, env: commands.append(command) or 0)
    command.main(["tests/system", "-x"])
    assert [each[-4:] for each in commands] == [
        ["-m", mark, "tests/system", "-x"] for mark in ("not timed and not alone", "timed", "alone")
    ]
    many, few, one = (int(each[each.index("-n") + 1]) for each in commands)
    assert many > few
    assert one == 1


def test_workers_share_compiled_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    environments: list[dict[str, str]] = []
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1")
    monkeypatch.setattr(subprocess, "call", lambda command, env: environments.append(env) or 0)
    command.main(["tests/system"])
    assert not any("PYTHONDONTWRITEBYTECODE" in environment for environment in environments)


@pytest.mark.parametrize(
    ("words", "missing"),
    [
        ("tests interfaces/reactive_node --ignore=tests/page", ""),
        ("tests/supervision/test_test_command.py::test_workers -k word -x", ""),
        ("nix", "nix"),
        ("tests --ignore=tests/page nix/test_it.py::test tests/nix", "nix/test_it.py::test, tests/nix"),
    ],
)
def test_a_missing_path_is_named_and_nothing_runs(
    words: str, missing: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "call", lambda command, env: commands.append(command) or 0)
    assert command.main(words.split()) == (4 if missing else 0)
    assert bool(commands) != bool(missing)
    assert capsys.readouterr().err == (f"TESTS: {missing}: no such file or directory\n" if missing else "")
