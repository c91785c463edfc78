"""The distributions of this repository: what their wheels hold, and that they run when installed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from deploy.supervision.processes import ROOT

FOLDERS = {
    "reactive-node": ROOT / "interfaces" / "reactive_node",
    "rclpy-ground": ROOT / "deploy" / "ground",
    "rclpy-simulation": ROOT / "tests" / "simulation_kit",
    "ros2-python-tools": ROOT / "deploy" / "tools",
}
PROGRAMS = {
    "reactive-node": "import reactive_node.testing; print(reactive_node.__file__)",
    "rclpy-ground": "import rclpy_ground.seam; rclpy_ground.seam.check(); print(rclpy_ground.__file__)",
    "rclpy-simulation": "import rclpy_simulation.testing; print(rclpy_simulation.__file__)",
    "ros2-python-tools": """
from importlib.metadata import distribution
(command,) = distribution("ros2-python-tools").entry_points
assert command.name == "ros2"
print(command.load().__code__.co_filename)
""",
}
"""They use each installed distribution and print where its modules are."""
INSTALL = ["--no-index", "--no-deps", "--no-build-isolation", "--no-compile", "--disable-pip-version-check"]


def run(*arguments: str, cwd: Path, **environment: str) -> str:
    command = [sys.executable, *arguments]
    done = subprocess.run(
        command, cwd=cwd, env=os.environ | environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module", params=FOLDERS)
def name(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def built(name: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("built")
    build = ["-m", "hatchling", "build", "-d", str(directory)]
    run(*build, cwd=FOLDERS[name], AMENT_PREFIX_PATH=str(directory))  # as of a sourced ROS 2
    stem = name.replace("-", "_")
    assert all(path.name.startswith(f"{stem}-") for path in directory.iterdir())
    return directory


def contents(wheel: Path) -> dict[str, bytes]:
    """Return the files of a wheel, without what describes it."""
    with ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist() if ".dist-info/" not in name}


def test_wheel_holds_the_sources(name: str, built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    source = FOLDERS[name] / "src"
    sources = {str(path.relative_to(source)) for path in source.rglob("*") if path.is_file()}
    assert contents(wheel).keys() == {file for file in sources if "__pycache__" not in file}


def test_type_checkers_see_that_every_package_has_types(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    files = contents(wheel)
    packages = {file.partition("/")[0] for file in files if file.endswith(".py")}
    assert {f"{package}/py.typed" for package in packages} <= files.keys()


@pytest.mark.parametrize("pattern", ["*.whl", "*.tar.gz"])
def test_distribution_runs_where_it_is_installed(
    name: str, built: Path, pattern: str, tmp_path: Path
) -> None:
    (distribution,) = built.glob(pattern)
    (wheel,) = built.glob("*.whl")
    run("-m", "pip", "install", *INSTALL, "--target", str(tmp_path), str(distribution), cwd=tmp_path)
    for file, content in contents(wheel).items():
        assert (tmp_path / file).read_bytes() == content
    paths = [str(tmp_path), os.environ.get("PYTHONPATH", "")]
    if name == "rclpy-simulation":
        paths.insert(1, str(FOLDERS["rclpy-ground"] / "src"))
    python_path = os.pathsep.join(filter(None, paths))
    files = run("-c", PROGRAMS[name], cwd=tmp_path, PYTHONPATH=python_path)
    assert all(file.startswith(f"{tmp_path}/") for file in files.split())
