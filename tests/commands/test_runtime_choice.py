"""Which rclpy a command of this checkout gets, and what it stands on."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.commands import setup
from deploy.supervision import rclpy_choice
from deploy.supervision.processes import ROOT

SECURE = {"ROS_SECURITY_ENABLE": "true"}
CYCLONE = {"RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}
ROS = "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/__init__.py"
MIDDLEWARE = "from rclpy.utilities import get_rmw_implementation_identifier as rmw; print(rmw())"


def in_venv(program: str, **environment: str) -> str:
    """Return what a Python program prints that the commands of make run."""
    command = [str(ROOT / "deploy" / "commands" / "venv.sh"), "-c", program]
    return subprocess.check_output(command, env=os.environ | environment, text=True, timeout=30).strip()


@pytest.mark.skipif(bool(rclpy_choice.sourced_rclpy()), reason="platform: a sourced ROS 2 wins")
@pytest.mark.parametrize("more", [{}, CYCLONE])
def test_runtime_chooses_what_rclpy_stands_on(more: dict[str, str]) -> None:
    assert in_venv(MIDDLEWARE, RUNTIME="") == "rmw_fastrtps_cpp"
    assert in_venv(MIDDLEWARE, RUNTIME="cyclonedds", **more) == "rmw_cyclonedds_cpp"
    assert (
        in_venv("import rclpy; rclpy.init(); rclpy.create_node('node')", RUNTIME="cyclonedds", **more) == ""
    )


def test_interpreter_of_the_default_runtime_starts_once_with_its_libraries() -> None:
    program = "import os; print(open('/proc/self/environ').read().split(chr(0)))"
    environment = in_venv(program, RUNTIME="", LD_LIBRARY_PATH="/opt/mine")
    if rclpy_choice.sourced_rclpy():  # it brings its libraries itself
        assert "'LD_LIBRARY_PATH=/opt/mine'" in environment
    else:
        assert f"'LD_LIBRARY_PATH={ROOT}/.venv/lib:{ROOT}/.venv/lib/python3" in environment
        assert ".libs:/opt/mine'" in environment
    assert "'_ROS_WHEELS_BOOTSTRAP_COMPLETE=1'" in environment  # otherwise they start the interpreter again


def test_rclpy_in_pythonpath_is_a_sourced_ros(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").touch()
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])  # as if pip had installed it
    monkeypatch.setenv("PYTHONPATH", f"{ROOT}{os.pathsep}")
    assert rclpy_choice.sourced_rclpy() == ""
    monkeypatch.setenv("PYTHONPATH", f"/none{os.pathsep}{tmp_path}")
    assert rclpy_choice.sourced_rclpy() == str(tmp_path / "rclpy" / "__init__.py")


@pytest.mark.parametrize(
    ("environment", "ros", "machine", "reason"),
    [
        (
            {"RUNTIME": "embeded"},
            "",
            "x86_64",
            "RUNTIME=embeded: it is empty for the middleware of ROS 2",
        ),
        (
            {"RUNTIME": "cyclonedds"},
            ROS,
            "x86_64",
            f"its rclpy wins ({ROS}); use another shell",
        ),
        ({}, "", "aarch64", "source an installed ROS 2"),
        (
            CYCLONE,
            "",
            "x86_64",
            "RMW_IMPLEMENTATION=rmw_cyclonedds_cpp: PyPI has",
        ),
        (
            SECURE,
            "",
            "x86_64",
            "use RUNTIME=cyclonedds with `apt-get install libddsc0t64` (on Debian 12, libddsc0debian),"
            " or source an",
        ),
        ({"RUNTIME": "cyclonedds"} | SECURE, "", "x86_64", ""),
        (SECURE, ROS, "x86_64", ""),
        ({"RUNTIME": "", "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp"}, "", "x86_64", ""),
        ({"RUNTIME": "cyclonedds"} | CYCLONE, "", "x86_64", ""),
        (CYCLONE, ROS, "aarch64", ""),
    ],
)
def test_runtime_that_cannot_be_had_is_refused(
    environment: dict[str, str], ros: str, machine: str, reason: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(setup.platform, "machine", lambda: machine)
    try:
        setup.check_runtime(environment, ros)
        refusal = ""
    except setup.SetupError as error:
        refusal = str(error)
    assert reason in refusal
    assert bool(reason) == bool(refusal)
    assert "\n" not in refusal


def test_machine_without_glibc_has_no_wheels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(setup.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(setup.platform, "libc_ver", lambda: ("glibc", "2.28"))
    assert setup.has_wheels()
    for library in (("glibc", "2.27"), ("", "")):
        monkeypatch.setattr(setup.platform, "libc_ver", lambda library=library: library)
        assert not setup.has_wheels()
