"""Each variable of the table: what becomes of it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.commands import setup
from deploy.commands.parameters import check_environment
from deploy.supervision.environment import RANGE, of_supervisord, set_middleware
from deploy.supervision.errors import DeploymentError
from deploy.supervision.processes import ROOT
from deploy.supervision.system import System
from deploy.supervision.variables import OVERRIDDEN, REFUSED, RESPECTED, TABLE, Variable, kept
from interfaces.service import middleware

ROWS = [
    pytest.param(row, name.replace("*", "SOMETHING"), id=name) for row in TABLE for name in row.names.split()
]
EARLY = ("PYTHON", "SUPERVISOR_", "REACTIVE_ARM_SYSTEM")
"""What counts before a module can decide."""
OWN = {"PYTHONUNBUFFERED": "1", "OPENBLAS_NUM_THREADS": "1"}
BAD = {
    "ROS_DOMAIN_ID": "300",
    "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
    "ROS_SECURITY_ENABLE": "true",
    "ROS_SECURITY_STRATEGY": "Permissive",
    "RUNTIME": "mine",
    "RMW_IMPLEMENTATION": "rmw_mine",
    "FASTRTPS_DEFAULT_PROFILES_FILE": "/nowhere.xml",
}
HARMFUL = {
    "PYTHONHOME": "/nowhere",
    "PYTHONSAFEPATH": "1",
    "PYTHONINSPECT": "1",
    "PYTHONWARNINGS": "error",
    "PYTHONPLATLIBDIR": "nowhere",
    "PYTHONHASHSEED": "no number",
    "PYTHONIOENCODING": "nothing",
    "PYTHONMALLOC": "nothing",
    "REACTIVE_ARM_SYSTEM": "/run",
    "SUPERVISOR_PROCESS_NAME": "velocity",
}


def run(*command: str, **environment: str) -> tuple[int, str, str]:
    """Run a command in the checkout, with more variables; return its exit code and what it prints."""
    shell = os.environ | environment
    done = subprocess.run(
        command, cwd=ROOT, env=shell, capture_output=True, text=True, stdin=subprocess.DEVNULL
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize(("row", "name"), ROWS)
def test_services_get_what_the_table_says(row: Variable, name: str) -> None:
    assert row.decision in (RESPECTED, OVERRIDDEN, REFUSED)
    assert row.reason
    shell = {name: "theirs"}
    assert kept(shell) == ({} if row.decision == OVERRIDDEN else shell)
    given = of_supervisord(shell, Path("/run")).get(name)
    if row.decision == OVERRIDDEN:
        assert given != "theirs"
        assert given == OWN.get(name, given)
    else:
        assert given is not None
        assert given.endswith("theirs")


@pytest.mark.parametrize(("row", "name"), [each for each in ROWS if each.values[1].startswith(EARLY)])
def test_interpreter_gets_what_the_table_says(row: Variable, name: str) -> None:
    show = '. deploy/commands/entry.sh; printenv "$0" || echo no'
    printed = "no\n" if row.decision == OVERRIDDEN else "theirs\n"
    assert run("sh", "-ec", show, name, **{name: "theirs"}) == (0, printed, "")


@pytest.mark.parametrize(("row", "name"), [each for each in ROWS if each.values[1].startswith("PIP_")])
def test_pip_gets_what_the_table_says(
    row: Variable, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(name, "theirs")
    monkeypatch.setenv("PYTHONPATH", "theirs")
    log = tmp_path / "log"
    setup.step("the environment", ["env"], log)
    lines = log.read_text().splitlines()
    assert (f"{name}=theirs" in lines) == (row.decision != OVERRIDDEN)
    assert "PYTHONPATH=theirs" not in lines


def test_value_that_cannot_be_obeyed_is_refused_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = {name for row in TABLE if row.decision == REFUSED for name in row.names.split()}
    assert names == BAD.keys()
    monkeypatch.setattr(setup, "has_wheels", lambda: True)
    monkeypatch.setattr(middleware, "is_fast_dds", lambda: True)
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")

    def check(name: str, value: str) -> None:
        setup.check_runtime({name: value}, "")
        with monkeypatch.context() as patched:
            patched.setenv(name, value)
            check_environment(System(tmp_path))

    for name, value in BAD.items():
        with pytest.raises((DeploymentError, setup.SetupError), match=name):
            check(name, value)


@pytest.mark.parametrize("name", HARMFUL)
def test_harmful_variable_does_no_harm(name: str, tmp_path: Path) -> None:
    shell = {name: HARMFUL[name], "REACTIVE_ARM_RUN_DIR": str(tmp_path)}
    for command in (["make", "stop"], ["deploy/commands/venv.sh", "-c", "print('Nothing runs.')"]):
        assert run(*command, **shell) == (0, "Nothing runs.\n", "")


def test_own_module_hides_none_that_the_arm_needs(tmp_path: Path) -> None:
    for name in ("queue", "yaml", "signal_of_mine"):
        (tmp_path / f"{name}.py").write_text("mine = True")
    code = "import queue, yaml, signal_of_mine; print(hasattr(queue, 'mine'), hasattr(yaml, 'mine'))"
    shown = run("deploy/commands/venv.sh", "-c", code, PYTHONPATH=str(tmp_path))
    assert shown == (0, "False False\n", "")


def test_own_module_does_not_hide_those_of_the_set_up(tmp_path: Path) -> None:
    (tmp_path / "signal.py").write_text("raise SystemExit('mine')")
    shell = {"PYTHONPATH": str(tmp_path), "REACTIVE_ARM_RUN_DIR": str(tmp_path / "run")}
    assert run("make", "stop", **shell) == (0, "Nothing runs.\n", "")


@pytest.mark.parametrize("value", ["0", "1", ""])
def test_localhost_only_becomes_the_range(value: str) -> None:
    shell = {"ROS_LOCALHOST_ONLY": value, RANGE: "SUBNET", "ROS_STATIC_PEERS": "robot.example"}
    set_middleware(shell)
    assert "ROS_LOCALHOST_ONLY" not in shell
    assert shell[RANGE] == ("LOCALHOST" if value == "1" else "SUBNET")
    assert shell.get("ROS_STATIC_PEERS") == (None if value == "1" else "robot.example")


@pytest.mark.parametrize("name", ["ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTRTPS_DEFAULT_PROFILES_FILE"])
def test_empty_variable_is_none(name: str) -> None:
    given: dict[str, str] = {}
    set_middleware(given)
    empty = {name: ""}
    set_middleware(empty)
    assert empty == given


def test_log_files_of_other_programs_do_not_grow(tmp_path: Path) -> None:
    system = System(tmp_path)
    folder = Path(of_supervisord({"ROS_LOG_DIR": "/elsewhere"}, tmp_path)["ROS_LOG_DIR"])
    assert folder.is_relative_to(system.run)
    folder.mkdir(parents=True)
    (folder / "python3_1_1.log").touch()
    system.part_logs()
    assert not folder.exists()


def test_set_up_that_pip_leads_elsewhere_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setup, "PYTHON", sys._base_executable)
    monkeypatch.setattr(setup, "step", lambda *arguments, **options: None)
    monkeypatch.setattr(setup, "STAMP", tmp_path / "stamp")
    monkeypatch.setattr(setup, "_write_pth", lambda **options: None)
    monkeypatch.setattr(setup, "_refuse_while_running", lambda: None)
    with pytest.raises(setup.SetupError, match="pip has not installed into"):
        setup.make("")
