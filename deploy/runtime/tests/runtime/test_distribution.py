"""The runtime as a distribution: wheel, source distribution and installation."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

RUNTIME = Path(__file__).parents[2]
SOURCE = RUNTIME / "src"
OFFLINE = ["--no-index", "--no-deps", "--no-build-isolation", "--no-compile", "--quiet"]
INSTALL = [sys.executable, "-m", "pip", "install", *OFFLINE]
PROGRAM = """
import rclpy, std_srvs.srv, rosidl_runtime_embedded
from geometry_msgs.msg import Pose
assert Pose._deserialize(Pose._serialize(Pose())) == Pose()
print(rclpy.__file__, std_srvs.__file__, rosidl_runtime_embedded.__file__)
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of a wheel and a source distribution, both built from this tree."""
    directory = tmp_path_factory.mktemp("built")
    # An AMENT_PREFIX_PATH, as of a sourced ROS 2, has no influence.
    environment = os.environ | {"AMENT_PREFIX_PATH": str(directory)}
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(directory)]
    subprocess.run(command, cwd=RUNTIME, env=environment, check=True, stdout=subprocess.DEVNULL, timeout=60)
    return directory


def test_wheel_has_the_sources_and_a_stub_of_each_module_of_interfaces(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        files = {name for name in archive.namelist() if ".dist-info/" not in name}
        stub = archive.read("std_msgs/msg/__init__.pyi").decode()
    stubs = {name for name in files if name.endswith(".pyi")}
    sources = {str(path.relative_to(SOURCE)) for path in SOURCE.rglob("*") if path.is_file()}
    assert files - stubs == {name for name in sources if "__pycache__" not in name}
    definitions = {Path(name) for name in files if name.endswith((".msg", ".srv", ".action"))}
    assert {path.parent / "__init__.pyi" for path in definitions} <= {Path(name) for name in stubs}
    assert "class Float64(Message):\n    data: float\n" in stub


def test_type_checkers_are_told_that_every_package_has_types(built: Path) -> None:
    (wheel,) = built.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        files = archive.namelist()
    packages = {name.partition("/")[0] for name in files if name.endswith(".py")}
    assert {f"{package}/py.typed" for package in packages} <= set(files)


def test_source_distribution_installs_as_its_wheel(built: Path, tmp_path: Path) -> None:
    (source,) = built.glob("*.tar.gz")
    (wheel,) = built.glob("*.whl")
    subprocess.run([*INSTALL, "--target", str(tmp_path), str(source)], check=True, timeout=120)
    with zipfile.ZipFile(wheel) as archive:
        for name in archive.namelist():
            if ".dist-info/" not in name:
                assert (tmp_path / name).read_bytes() == archive.read(name)


def test_wheel_runs_where_it_is_installed(built: Path, tmp_path: Path) -> None:
    (wheel,) = built.glob("*.whl")
    subprocess.run([*INSTALL, "--target", str(tmp_path), str(wheel)], check=True, timeout=120)
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "RUNTIME": ""}  # not the rclpy of this checkout
    files = subprocess.check_output([sys.executable, "-c", PROGRAM], env=environment, text=True, timeout=30)
    assert all(file.startswith(f"{tmp_path}/") for file in files.split())
