"""reactive-arm as a package of a ROS 2 workspace: installed as colcon installs it, and started from there."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from deploy.supervision import manifest, processes
from deploy.supervision.processes import ROOT
from tests.system.sites import Site

PACKAGE = "reactive_arm"


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An installation without a trace of the checkout on its path."""
    base = tmp_path_factory.mktemp("colcon")
    build, prefix = base / "build", base / "install"
    build.mkdir()
    # The command line of colcon-core's Python build.
    steps = [
        *("egg_info", "--egg-base", str(build)),
        *("build", "--build-base", str(build / "build")),
        *("install", "--prefix", str(prefix), "--record", str(build / "install.log")),
        *("--install-scripts", str(prefix / "lib" / PACKAGE), "--single-version-externally-managed"),
        "install_data",
    ]
    done = subprocess.run([sys.executable, "setup.py", *steps], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return prefix


def command(prefix: Path, executable: str, *arguments: str) -> list[str]:
    """Return the command that `ros2 run` starts, in the environment of the sourced workspace."""
    (python_path,) = map(str, prefix.glob("lib/python3*/site-packages"))
    python_path += os.pathsep + os.environ.get("PYTHONPATH", "")  # of a sourced ROS 2
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = ["env", "-C", str(prefix), f"PYTHONPATH={python_path.rstrip(os.pathsep)}", f"PATH={path}"]
    return [*environment, str(prefix / "lib" / PACKAGE / executable), *arguments]


def test_each_program_has_an_executable(prefix: Path) -> None:
    executables = {path.name for path in (prefix / "lib" / PACKAGE).iterdir()}
    assert executables == {"arm", *(program.name for program in manifest.programs())}
    assert all(os.access(prefix / "lib" / PACKAGE / name, os.X_OK) for name in executables)


def test_common_names_stay_out_of_the_import_path_of_the_workspace(prefix: Path) -> None:
    (python_path,) = prefix.glob("lib/python3*/site-packages")
    assert {path.name for path in python_path.iterdir() if path.suffix != ".egg-info"} == {
        PACKAGE,
        "mcap_files",
        "reactive_node",
        "ros_yaml",
    }
    assert not (prefix / "share" / PACKAGE / "deploy" / "runtime").exists()


def test_colcon_finds_marker_manifest_and_launch_file(prefix: Path) -> None:
    share = prefix / "share"
    for file in (
        f"ament_index/resource_index/packages/{PACKAGE}",
        f"{PACKAGE}/package.xml",
        f"{PACKAGE}/launch/arm.launch.py",
    ):
        assert (share / file).is_file()


def test_package_has_the_version_of_the_changelog(prefix: Path) -> None:
    newest = re.search(r"(?m)^## ([\d.]+)", (ROOT / "CHANGELOG.md").read_text())
    assert newest
    assert ElementTree.parse(prefix / "share" / PACKAGE / "package.xml").findtext("version") == newest[1]
    assert list(prefix.glob(f"lib/python3*/site-packages/{PACKAGE}-{newest[1]}-*.egg-info"))


def test_installed_service_has_its_arguments(site: Site, prefix: Path) -> None:
    code, output = site.do_command(*command(prefix, "config_l1", "--ros-args", "-p", "value:=-1.0"))
    assert (code, output.partition(":")[0]) == (2, "config_l1")


def test_installed_arm_starts_from_its_own_files(site: Site, prefix: Path) -> None:
    code, output = site.do_command(*command(prefix, "arm", "start", "demo"))
    assert code == 0, output
    (supervisord,) = (each for each in processes.of_system(site.run) if not each.program)
    words = Path(f"/proc/{supervisord.pid}/cmdline").read_text().split("\0")
    assert str(prefix / "share" / PACKAGE / "deploy" / "supervisord.conf") in words
    paths = {
        processes.environment_of(each.pid)["PYTHONPATH"].split(os.pathsep)[0]
        for each in processes.of_system(site.run)
    }
    assert paths == {str(prefix / "share" / PACKAGE)}
    code, table = site.do_command(*command(prefix, "arm", "status"))
    rows = [line.split() for line in table[table.index("SERVICE") :].splitlines()[1:]]
    assert (code, [name for name, *_ in rows]) == (0, [each.name for each in manifest.programs()])
    # supervisord calls a process STARTING for its first second; all services have reported before that.
    assert {state for _, state, *_ in rows} <= {"STARTING", "RUNNING"}


def test_missing_package_is_reported_with_the_remedy(prefix: Path, tmp_path: Path) -> None:
    bare = [sys._base_executable, "-S", "-c"]  # type: ignore[attr-defined]
    (python_path,) = prefix.glob("lib/python3*/site-packages")
    executable = str(prefix / "lib" / PACKAGE / "arm")
    script = f"import reactive_arm, sys; sys.argv[0] = {executable!r}; reactive_arm.main()"
    done = subprocess.run(
        [*bare, script], cwd=tmp_path, env={"PYTHONPATH": str(python_path)}, capture_output=True, text=True
    )
    (line,) = done.stderr.splitlines()
    lacking, _, remedy = line.partition(": ")
    assert "reactivex, supervisor" in lacking
    assert Path(remedy.split()[-1]).read_text() == (ROOT / "deploy/requirements/system.txt").read_text()
    assert done.returncode == 1


@pytest.mark.skipif(importlib.util.find_spec("launch") is None, reason="platform: no ROS 2 with launch")
def test_launch_file_declares_its_arguments(prefix: Path) -> None:
    path = os.pathsep.join([str(prefix), os.environ["AMENT_PREFIX_PATH"]])
    shown = subprocess.run(
        ["ros2", "launch", PACKAGE, "arm.launch.py", "--show-args"],
        env=os.environ | {"AMENT_PREFIX_PATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert re.findall(r"'(\w+)':\n", shown.stdout) == ["scenario", "namespace", "parameters", "web"]
