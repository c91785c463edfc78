from __future__ import annotations

import configparser
import os
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from textwrap import dedent

import pytest

from deploy.supervision import manifest, parameter_file
from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import run_directory
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


def section(name: str) -> dict[str, str]:
    """Return the settings of a program in the chosen manifest."""
    conf = configparser.RawConfigParser()
    conf.read(manifest.path())
    return dict(conf[f"program:{name}"])


def test_without_a_file_the_manifest_is_ours() -> None:
    with manifest.chosen(""):
        assert manifest.path() == manifest.PATH


def test_own_programs_join_ours_with_the_same_settings(own: Path) -> None:
    own.write_text(GUARD + "startsecs = 3  ; mine\nstopwaitsecs = 2\n")
    with manifest.chosen(str(own)):
        *ours, guard = manifest.programs()
        assert (tuple(ours), guard) == (OURS, manifest.Program("guard", "services.examples.speed_guard", ()))
        shared, settings = section("kinematics"), section("guard")
    arguments = f"--ros-args -r __node:=guard --params-file {run_directory()}/parameters.yaml"
    command = f"python3 -m services.examples.speed_guard {arguments}"
    assert settings == shared | {"command": command, "startsecs": "3", "stopwaitsecs": "2"}


def test_own_program_with_a_directory_finds_its_parameters(
    own: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = own.parent / "it's 100%"
    monkeypatch.setenv("REACTIVE_ARM_RUN_DIR", str(run))
    own.write_text(GUARD + "directory = /tmp\n")
    with manifest.chosen(str(own)):
        words = shlex.split(section("guard")["command"] % {})  # as supervisord reads it
    assert words[-1] == str(run / "parameters.yaml")


@pytest.mark.parametrize("directory", ["100%%/work", "%(here)s/100%%/work", "~/100%%/work"])
def test_paths_of_own_program_count_from_its_file(
    own: Path, directory: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(own.parent))
    (own.parent / "100%" / "work").mkdir(parents=True)
    own.write_text(GUARD + f"directory = {directory}\n")
    with manifest.chosen(str(own)):
        assert section("guard")["directory"] % {} == str(own.parent / "100%" / "work")


@pytest.mark.parametrize(
    ("setting", "starts"), [("", True), ("autostart = true\n", True), ("autostart = False\n", False)]
)
def test_own_program_starts_with_the_system_unless_it_says_otherwise(
    own: Path, setting: str, starts: bool
) -> None:
    own.write_text(GUARD + setting)
    with manifest.chosen(str(own)):
        assert manifest.programs()[-1].starts is starts


def test_own_file_may_begin_with_a_byte_order_mark(own: Path) -> None:
    own.write_text("\ufeff" + GUARD)
    with manifest.chosen(str(own)):
        assert manifest.programs()[-1].name == "guard"


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
        assert manifest.programs()[-1] == manifest.Program("guard", "my_own_guard", ("fast",))
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
    ("text", "shown"),
    [
        ("def wire(", "SyntaxError: '(' was never closed (broken_guard.py, line 1)"),
        ("import no_such_driver", "ModuleNotFoundError: No module named 'no_such_driver'"),
        ("raise RuntimeError('no port:\\n/dev/ttyUSB0')", "RuntimeError: no port: /dev/ttyUSB0"),
        ("raise SystemExit('no GPIO')", "SystemExit: no GPIO"),
    ],
)
def test_own_program_that_cannot_be_imported_is_one_line(own: Path, text: str, shown: str) -> None:
    (own.parent / "broken_guard.py").write_text(text)
    own.write_text("[program:guard]\ncommand = python3 -m broken_guard\n")
    parameters = own.with_name("mine.yaml")
    parameters.write_text("{}")
    with manifest.chosen(str(own)), pytest.raises(UserError) as raised:
        parameter_file.load(str(parameters), "/")
    assert str(raised.value) == f"broken_guard: cannot be imported: {shown}"


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
    (GUARD + "directory = work", "{own}: [program:guard] directory: there is no folder {own.parent}/work"),
    (GUARD + GUARD, "{own}: While reading from '{own}' [line 3]: section 'program:guard' already exists"),
    ("guard", "{own}: File contains no section headers."),
]


@pytest.fixture(params=ERRORS, ids=lambda error: repr(error[0][:40]))
def error(request: pytest.FixtureRequest, own: Path) -> Iterator[str]:
    """What is printed about a file with an error."""
    text, shown = request.param
    own.write_text(text)
    return shown.format(own=own)


def test_error_in_the_file_is_one_line(own: Path, error: str) -> None:
    with pytest.raises(DeploymentError) as raised, manifest.chosen(str(own)):
        pass
    assert str(raised.value).startswith(error)
    assert "\n" not in str(raised.value)


def test_missing_file_is_named() -> None:
    with pytest.raises(DeploymentError, match=r"^MANIFEST=/no/robot\.conf: No such file"):
        manifest.chosen("/no/robot.conf").__enter__()
