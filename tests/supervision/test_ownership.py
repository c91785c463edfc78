from __future__ import annotations

import os
import re
from pathlib import Path

import pytest

from deploy.supervision.errors import DeploymentError
from deploy.supervision.ownership import check
from deploy.supervision.processes import RUN_DIRECTORY
from deploy.supervision.system import System
from tests.users import NOBODY, needs_root, public_folder


def refused(run: Path, words: str) -> None:
    with pytest.raises(DeploymentError, match=re.escape(words)) as raised:
        check(run)
    assert "\n" not in str(raised.value)
    assert RUN_DIRECTORY in str(raised.value) or "chmod" in str(raised.value)


@needs_root
def test_run_directory_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = tmp_path / "run"
    run.mkdir()
    run.chmod(0o755)  # whatever the umask is
    os.chown(run, NOBODY, NOBODY)
    refused(run, f"The run directory {run} belongs to nobody (uid {NOBODY}, mode 0755)")
    monkeypatch.setenv(RUN_DIRECTORY, str(run))
    with pytest.raises(DeploymentError):
        System()


@pytest.mark.parametrize("mode", [0o777, 0o1777, 0o702])
def test_run_directory_that_others_can_write_in_is_refused(tmp_path: Path, mode: int) -> None:
    tmp_path.chmod(mode)
    refused(tmp_path, f"mode {mode:04o}): chmod 700 {tmp_path}")


@needs_root
def test_group_of_others_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o770)
    check(tmp_path)
    os.chown(tmp_path, 0, NOBODY)
    refused(tmp_path, "is open to others")


def test_folder_in_which_others_can_replace_it_is_refused(tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir(0o700)
    tmp_path.chmod(0o777)
    refused(run, f"can be replaced by others, {tmp_path} belongs to")
    tmp_path.chmod(0o1777)  # as /tmp: only the owner renames what is in it
    check(run)


@needs_root
def test_folder_of_another_user_is_refused(tmp_path: Path) -> None:
    run = tmp_path / "folder" / "run"
    run.mkdir(0o700, parents=True)
    os.chown(run.parent, NOBODY, NOBODY)
    refused(run, f"can be replaced by others, {run.parent} belongs to nobody")


@needs_root
def test_link_of_another_user_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with public_folder() as folder:
        folder.chmod(0o1777)
        run, link = folder / "run", folder / "link"
        run.mkdir(0o700)
        link.symlink_to(run)
        check(link)
        os.chown(link, NOBODY, NOBODY, follow_symlinks=False)
        refused(link, f"can be replaced by others, {link} belongs to nobody")
        monkeypatch.setenv(RUN_DIRECTORY, str(link))
        with pytest.raises(DeploymentError):
            System()


def test_run_directory_that_is_not_there_is_made_for_its_user(tmp_path: Path) -> None:
    system = System(tmp_path / "new" / "run")
    with system.alone():
        assert system.run.stat().st_mode & 0o777 == 0o700


@needs_root
def test_directory_that_another_user_made_in_time_is_refused(tmp_path: Path) -> None:
    system = System(tmp_path / "run")
    system.run.mkdir()
    os.chown(system.run, NOBODY, NOBODY)
    with pytest.raises(DeploymentError, match="belongs to nobody"), system.alone():
        pass
