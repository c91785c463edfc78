"""`make test`: two runs of pytest, of which the second has the tests that run alone."""

from __future__ import annotations

import subprocess

import pytest

from deploy.commands import test as command


@pytest.mark.parametrize(
    ("codes", "result"),
    [([5, 5], 5), ([0, 5], 0), ([5, 0], 0), ([1, 0], 1), ([0, 1], 1), ([2], 2), ([0, 3], 3)],
)
def test_exit_code_is_the_worst_and_an_interruption_ends_it(
    monkeypatch: pytest.MonkeyPatch, codes: list[int], result: int
) -> None:
    left = list(codes)
    monkeypatch.setattr(subprocess, "call", lambda command: left.pop(0))
    assert command.main(["tests"]) == result
    assert left == []


def test_every_test_runs_once_and_those_marked_alone_in_no_worker(monkeypatch: pytest.MonkeyPatch) -> None:
    commands: list[list[str]] = []
    monkeypatch.setattr(subprocess, "call", lambda command: commands.append(command) or 0)
    command.main(["tests/system", "-x"])
    shared, alone = commands
    assert shared[-4:] == ["-m", "not alone", "tests/system", "-x"]
    assert alone[-4:] == ["-m", "alone", "tests/system", "-x"]
    assert "-n" in shared
    assert "-n" not in alone
