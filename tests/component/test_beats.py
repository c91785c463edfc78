"""Signs of life of supervised processes, through a named pipe."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NoReturn

import pytest

from interfaces.arm_variables import SYSTEM
from interfaces.service import UserError, beats
from interfaces.service.beats import Beats, beat


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(SYSTEM, str(tmp_path))
    return tmp_path


def test_last_sign_of_life_of_each_process_is_taken_once(run: Path) -> None:
    reader = Beats(run)
    assert reader.take() == {}
    code = "from interfaces.service.beats import beat; import os; beat(); print(os.getpid())"
    root = Path(__file__).parents[2]
    other = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, check=True)
    beat()
    before = time.monotonic()
    beat()
    taken = reader.take()
    assert taken.keys() == {os.getpid(), int(other.stdout)}
    assert before <= taken[os.getpid()] <= time.monotonic()
    assert reader.take() == {}


def test_process_without_a_sentinel_goes_on(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    beat()  # no sentinel has begun
    assert not list(run.iterdir())
    os.mkfifo(run / "beats")
    beat()  # it has ended
    monkeypatch.delenv(SYSTEM)
    beat()  # not supervised


def test_full_pipe_of_a_sentinel_that_hangs_blocks_no_service(run: Path) -> None:
    reader = Beats(run)
    begin = time.monotonic()
    for _ in range(10_000):
        beat()
    assert time.monotonic() - begin < 10.0
    assert reader.take().keys() == {os.getpid()}
    beat()
    assert reader.take().keys() == {os.getpid()}


def test_next_sentinel_reads_on(run: Path) -> None:
    Beats(run)
    reader = Beats(run)
    beat()
    assert os.getpid() in reader.take()


def test_only_the_owner_can_write(run: Path) -> None:
    Beats(run)
    assert (run / "beats").stat().st_mode & 0o777 == 0o600


def test_run_directory_without_named_pipes_is_refused(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> NoReturn:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(beats.os, "mkfifo", refuse)
    with pytest.raises(UserError, match=r"beats: Operation not permitted: REACTIVE_ARM_RUN_DIR must be on"):
        Beats(run)
