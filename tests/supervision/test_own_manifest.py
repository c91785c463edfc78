from __future__ import annotations

import configparser
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import pytest

from deploy.supervision import manifest, parameter_file
from deploy.supervision.errors import DeploymentError
from deploy.supervision.reaction import reaction
from interfaces.service import UserError

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


def test_parameters_of_own_program_are_known_whatever_its_arguments(own: Path) -> None:
    text = """
        from dataclasses import dataclass
        from interfaces.service import parameter

        @dataclass
        class Parameters:
            limit: float = parameter(1.0, None, "rad", "the greatest angle")
    """
    (own.parent / "guard_of_a_side.py").write_text(dedent(text))
    own.write_text("[program:guard]\ncommand = python3 -m guard_of_a_side left\n")
    with manifest.chosen(str(own)):
        assert [*parameter_file.declared()["guard"]] == ["limit", "use_sim_time"]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("def wire(", "SyntaxError: '(' was never closed (broken_guard.py, line 1)"),
        ("import no_such_driver", "ModuleNotFoundError: No module named 'no_such_driver'"),
        ("raise RuntimeError('no port:\\n/dev/ttyUSB0')", "RuntimeError: no port: /dev/ttyUSB0"),
        ("raise SystemExit('no GPIO')", "SystemExit: no GPIO"),
    ],
)
def test_own_program_that_cannot_be_imported_is_one_line(own: Path, text: str, told: str) -> None:
    (own.parent / "broken_guard.py").write_text(text)
    own.write_text("[program:guard]\ncommand = python3 -m broken_guard\n")
    parameters = own.with_name("mine.yaml")
    parameters.write_text("{}")
    with manifest.chosen(str(own)), pytest.raises(UserError) as raised:
        parameter_file.load(str(parameters), "/")
    assert str(raised.value) == f"broken_guard: cannot be imported: {told}"


def test_bound_needs_no_import_of_own_program(own: Path) -> None:
    (own.parent / "guard_with_a_port.py").write_text("raise RuntimeError('the port is in use')")
    own.write_text("[program:guard]\ncommand = python3 -m guard_with_a_port\n")
    given = {"engine_controller": {"presence_timeout": 5.0}}
    document = {program: {"ros__parameters": parameters} for program, parameters in given.items()}
    with manifest.chosen(str(own)):
        assert parameter_file.reaction_to(document, "/") == reaction(given)


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
