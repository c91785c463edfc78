"""root in the checkout of another user, where its files would stop the owner's next start."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from tests.users import NOBODY, needs_root

pytestmark = needs_root


def files(folder: Path) -> set[Path]:
    return {*folder.rglob("*")}


@pytest.mark.parametrize("command", ["setup", "start", "stop", "status", "record", "test", "keystore"])
def test_root_is_refused_in_the_checkout_of_another_user(checkout: Path, command: str) -> None:
    os.chown(checkout, NOBODY, NOBODY)
    stamp = checkout / ".venv" / "made-from"  # as after a set-up
    stamp.parent.mkdir()
    stamp.touch()
    before = files(checkout)
    done = subprocess.run(["make", command], cwd=checkout, capture_output=True, text=True)
    assert done.returncode != 0
    line, *_ = done.stderr.splitlines()
    assert f"{checkout} belongs to nobody (uid {NOBODY})" in line
    assert "runuser -u nobody -- make" in line
    assert files(checkout) == before


def test_owner_without_a_name_is_reported_by_number(checkout: Path) -> None:
    os.chown(checkout, 54321, 54322)
    done = subprocess.run(["make", "stop"], cwd=checkout, capture_output=True, text=True)
    assert "setpriv --reuid=54321 --regid=54322 --clear-groups make" in done.stderr
    assert "docker run --user 54321:54322" in done.stderr


def test_root_that_cannot_write_in_a_checkout_leaves_nothing_behind(checkout: Path) -> None:
    os.chown(checkout, NOBODY, NOBODY)
    command = ["setpriv", "--bounding-set=-dac_override", "--inh-caps=-dac_override", "make", "stop"]
    done = subprocess.run(command, cwd=checkout, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "Nothing runs.\n")


def test_cdpath_leads_to_no_other_checkout(checkout: Path, tmp_path: Path) -> None:
    other = tmp_path / "other" / "deploy" / "commands"
    other.mkdir(parents=True)
    done = subprocess.run(
        ["make", "stop"],
        cwd=checkout,
        env=os.environ | {"CDPATH": str(other.parents[1])},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (0, "Nothing runs.\n")
