"""Where the settings of a system lie: in memory, not on a disk."""

from __future__ import annotations

import stat
from pathlib import Path

import pytest

from deploy.supervision import run_directory, supervisord
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import MEMORY, SETTINGS, RunDirectory
from deploy.supervision.system import System


@pytest.fixture
def run(tmp_path: Path) -> RunDirectory:
    return RunDirectory(tmp_path / "run")


def test_settings_lie_in_memory_and_leave_nothing_there(run: RunDirectory) -> None:
    run.forget_settings(["drive"])
    first = (run.run / SETTINGS).resolve()
    assert first.parent == MEMORY
    assert stat.S_IMODE(first.stat().st_mode) == 0o700
    assert [(file.name, file.read_text()) for file in first.iterdir()] == [("drive.yaml", "{}\n")]
    run.forget_settings([])
    second = (run.run / SETTINGS).resolve()
    run.remove_settings()
    assert [path for path in (first, second, run.run / SETTINGS) if path.exists()] == []
    run.remove_settings()  # there are none


def test_system_that_does_not_start_leaves_no_settings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    memory = tmp_path / "memory"
    memory.mkdir()
    monkeypatch.setattr(run_directory, "MEMORY", memory)
    monkeypatch.setattr(supervisord, "COMMAND", ("false",))
    system = System(tmp_path / "run")
    with pytest.raises(DeploymentError):
        system.start({})
    assert [*memory.iterdir()] == []
    assert not (system.run / SETTINGS).is_symlink()


def test_settings_lie_in_the_run_directory_where_memory_holds_no_files(
    run: RunDirectory, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run_directory, "MEMORY", tmp_path / "none")
    run.forget_settings(["drive"])
    assert (run.run / SETTINGS / "drive.yaml").exists()
    assert not (run.run / SETTINGS).is_symlink()
    run.forget_settings([])
    assert [*(run.run / SETTINGS).iterdir()] == []


def test_folder_of_the_user_behind_a_link_is_not_removed(run: RunDirectory, tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (own / "file").touch()
    run.run.mkdir()
    (run.run / SETTINGS).symlink_to(own)
    run.forget_settings([])
    run.remove_settings()
    assert (own / "file").exists()
