"""`make test`: runs of pytest, of which the later ones have the tests with bounds of time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

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
    assert [each[-5:-1] for each in commands] == [
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


TESTS = """
import pytest

def test_passes(): pass

@pytest.mark.parametrize("number", [1, 2])
def test_fails(number): assert not number

@pytest.fixture
def broken():
    yield
    raise LookupError

def test_fails_with_its_fixture(broken): raise ValueError

def test_is_skipped(): pytest.skip("it is")
"""


def test_last_line_counts_the_tests_of_all_phases(tmp_path: Path) -> None:
    timed = "@pytest.mark.timed\ndef test_passes_in_time(): pass"
    (tmp_path / "test_it.py").write_text(f"{TESTS}\n{timed}")
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n  timed\n  alone")
    arguments = [str(tmp_path), "-c", str(tmp_path / "pytest.ini")]
    done = subprocess.run(
        [sys.executable, "-m", "deploy.commands.test", *arguments], capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stdout.splitlines()[-1] == "2 passed, 3 failed, 1 skipped"


def test_last_line_follows_a_warning_if_not_all_tests_have_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(subprocess, "call", lambda command, env: 2)
    assert command.main(["tests/system"]) == 2
    assert capsys.readouterr().out == "Not all tests have run.\n0 passed, 0 failed, 0 skipped\n"
