from __future__ import annotations

import configparser
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.running import manifest
from deploy.running.errors import DeploymentError

GUARD = "[program:guard]\ncommand = python3 -m services.examples.speed_guard\n"
OURS = manifest.programs(manifest.PATH)


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment and the path of imports are as before after each test."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in (manifest.VARIABLE, "PYTHONPATH"):
        monkeypatch.setenv(name, os.environ.get(name, ""))


@pytest.fixture
def own(tmp_path: Path) -> Path:
    return tmp_path / "robot.conf"


def test_without_a_file_the_manifest_is_ours() -> None:
    with manifest.chosen(""):
        assert manifest.path() == manifest.PATH


def test_own_programs_join_ours_with_the_same_settings(own: Path) -> None:
    own.write_text(GUARD + "startsecs = 3  ; mine\nstopwaitsecs = 2\n")
    with manifest.chosen(str(own)):
        assert manifest.programs() == (*OURS, ("guard", "services.examples.speed_guard", (), manifest.ROBOT))
        conf = configparser.RawConfigParser()
        conf.read(manifest.path())
    ours, guard = dict(conf["program:kinematics"]), dict(conf["program:guard"])
    arguments = "--ros-args -r __node:=guard --params-file parameters.yaml"
    command = f"python3 -m services.examples.speed_guard {arguments}"
    assert guard == ours | {"command": command, "startsecs": "3", "stopwaitsecs": "2"}


def test_virtual_joints_give_way_to_real_ones() -> None:
    with manifest.chosen("", without=manifest.VIRTUAL_JOINTS):
        names = [each.name for each in manifest.programs()]
    assert names == [each.name for each in OURS if each.name not in manifest.VIRTUAL_JOINTS]
    assert "config_l1" in names


def test_page_sets_no_real_joint() -> None:
    show = "from deploy.operator.page import protocol; print(*protocol.LIMITS)"
    with manifest.chosen("", without=manifest.VIRTUAL_JOINTS):
        shown = subprocess.run([sys.executable, "-c", show], capture_output=True, text=True, check=True)
    assert shown.stdout.split() == ["l1", "l2"]


def test_modules_beside_the_file_are_found(own: Path) -> None:
    (own.parent / "my_own_guard.py").touch()
    own.write_text("[program:guard]\ncommand = python3 -m my_own_guard fast --ros-args -r a:=b\n")
    with manifest.chosen(str(own)):
        assert manifest.programs()[-1] == ("guard", "my_own_guard", ("fast",), manifest.ROBOT)
        assert os.environ["PYTHONPATH"].split(os.pathsep)[-1] == str(own.parent)


ERRORS = [
    ("", "{own}: names no program: add [program:NAME] with a command"),
    ("[program:kinematics]\ncommand = x", "{own}: [program:kinematics] has the name of a program of the arm"),
    ("[program:a b]\ncommand = x", "{own}: [program:a b] has no name of a node: letters, digits and _"),
    ("[group:guard]\nprograms = x", "{own}: [group:guard] is no [program:NAME]: the file may have no other"),
    ("[program:guard]", "{own}: [program:guard] has no command such as python3 -m MODULE: ''"),
    ("[program:guard]\ncommand = ./guard", "{own}: [program:guard] has no command such as python3 -m MODULE"),
    ("[program:guard]\ncommand = python3 -m", "{own}: [program:guard] has no command such as python3 -m"),
    ("[program:guard]\ncommand = python3 -m gurad", "{own}: [program:guard] runs the module gurad, which is"),
    (GUARD + GUARD, "{own}: While reading from '{own}' [line 3]: section 'program:guard' already exists"),
    ("guard", "{own}: File contains no section headers."),
]


@pytest.fixture(params=ERRORS, ids=lambda error: repr(error[0][:40]))
def error(request: pytest.FixtureRequest, own: Path) -> Iterator[str]:
    """What is told about a file with an error."""
    text, told = request.param
    own.write_text(text)
    return told.format(own=own)


def test_error_in_the_file_is_one_line(own: Path, error: str) -> None:
    with pytest.raises(DeploymentError) as raised, manifest.chosen(str(own)):
        pass
    assert str(raised.value).startswith(error)
    assert "\n" not in str(raised.value)


def test_missing_file_is_named() -> None:
    with pytest.raises(DeploymentError, match=r"^MANIFEST=/no/robot\.conf: No such file"):
        manifest.chosen("/no/robot.conf").__enter__()
