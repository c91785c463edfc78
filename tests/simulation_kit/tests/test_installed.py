"""The kit beside an installed ROS 2: no workspace, and none of this checkout on the path."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
from importlib.metadata import distributions
from pathlib import Path
from typing import NamedTuple

import pytest
from tests.simulation_kit.tests import test_replay

ROOT = Path(__file__).parents[3]
DISTRIBUTIONS = ("deploy/ground", "tests/simulation_kit", "deploy/tools")
SITE = Path(sysconfig.get_path("platlib"))
INSTALL = ["--no-index", "--no-deps", "--no-build-isolation", "--no-compile", "--disable-pip-version-check"]
WHEELS = [each for each in distributions(path=[str(SITE)]) if each.metadata["Name"].startswith("ros-")]

NODE = """
from pathlib import Path

import rclpy
from ament_index_python.packages import get_package_share_directory
from geometry_msgs.msg import PointStamped


def main():
    rclpy.init()
    node = rclpy.create_node("doubler")
    factor = float(Path(get_package_share_directory("strange"), "factor").read_text())
    publisher = node.create_publisher(PointStamped, "doubled", 10)

    def double(message):
        message.point.x *= factor
        publisher.publish(message)

    node.create_subscription(PointStamped, "point", double, 10)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
"""
TEST = """
import rclpy
from geometry_msgs.msg import PointStamped


def test_it_doubles(simulation):
    def talk():
        rclpy.init()
        node = rclpy.create_node("talker")
        publisher = node.create_publisher(PointStamped, "point", 10)
        node.create_timer(1.0, lambda: publisher.publish(PointStamped()))
        rclpy.spin(node)

    doubled = []
    simulation.tap(lambda writer, _: doubled.append(writer) if writer.topic == "rt/doubled" else None)
    simulation.start("strange.node")
    simulation.start(talk)
    simulation.run(60.0)
    assert len(doubled) > 55
"""


class Installed(NamedTuple):
    prefix: Path
    """As ``/opt/ros/jazzy``."""
    python: Path
    """Of a virtual environment that has the kit, and nothing of ROS 2."""

    def run(self, *arguments: str, cwd: Path) -> str:
        """Run Python as after ``source /opt/ros/jazzy/setup.bash``."""
        environment = {
            "AMENT_PREFIX_PATH": str(self.prefix),
            "LD_LIBRARY_PATH": str(self.prefix / "lib"),
            "PYTHONPATH": str(self.prefix / SITE.relative_to(sys.prefix)),
            "ROS_DISTRO": "jazzy",
        }
        command = [str(self.python), *arguments]
        done = subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Lay out the wheels of ROS 2 as an installed one, with a package of a stranger."""
    if not WHEELS:
        pytest.skip("platform: rclpy is not of PyPI")
    directory = tmp_path_factory.mktemp("installed")
    prefix, environment = directory / "opt" / "ros" / "jazzy", directory / "venv"
    packages = prefix / SITE.relative_to(sys.prefix)
    packages.mkdir(parents=True)
    of_ros = {file.parts[0] for wheel in WHEELS for file in wheel.files or () if ".." not in file.parts}
    for name in sorted(of_ros):
        if not name.endswith((".dist-info", ".pth", ".libs")):
            (packages / name).symlink_to(SITE / name)
    for library in [*Path(sys.prefix, "lib").glob("*.so*"), *SITE.glob("ros_*.libs/*")]:
        if not (link := prefix / "lib" / library.name).is_symlink():
            link.symlink_to(library)
    index = prefix / "share" / "ament_index" / "resource_index" / "packages"
    index.mkdir(parents=True)
    for share in Path(sys.prefix, "share").iterdir():
        if share.name != "ament_index":
            (prefix / "share" / share.name).symlink_to(share)
            (index / share.name).touch()
    (packages / "strange").mkdir()
    (packages / "strange" / "node.py").write_text(NODE)
    (prefix / "share" / "strange").mkdir()
    (prefix / "share" / "strange" / "factor").write_text("2.0")
    (index / "strange").touch()

    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(environment)], check=True)
    target = environment / SITE.relative_to(sys.prefix)
    folders = [str(ROOT / folder) for folder in DISTRIBUTIONS]
    pip = [sys.executable, "-m", "pip", "install", "-q", *INSTALL, "--target", str(target), *folders]
    subprocess.run(pip, check=True, timeout=120)
    there = {*of_ros, *(path.name for path in target.iterdir())}
    for other in SITE.iterdir():  # numpy, pytest and what the kit needs
        if other.name not in there and other.suffix != ".pth":
            (target / other.name).symlink_to(other)
    return Installed(prefix, environment / "bin" / "python")


def test_a_node_of_an_installed_package_is_tested(installed: Installed, tmp_path: Path) -> None:
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["rclpy_simulation.testing"]\n')
    (tmp_path / "test_strange.py").write_text(TEST)
    assert "1 passed" in installed.run("-m", "pytest", "-q", "-p", "no:cacheprovider", cwd=tmp_path)


def test_a_bag_is_replayed_to_it(installed: Installed, tmp_path: Path) -> None:
    test_replay.write(tmp_path / "in.mcap", test_replay.points())
    words = ["in.mcap", "--run", "strange.node", "--output", "out.mcap"]
    said = installed.run("-m", "rclpy_simulation", "replay", *words, cwd=tmp_path)
    assert ["/doubled", "100"] in [line.split() for line in said.splitlines()]
    doubled = test_replay.read(tmp_path / "out.mcap", "/doubled", test_replay.PointStamped)
    assert [message.point.x for _, message in doubled] == [2.0 * n for n in range(100)]


def test_everything_comes_from_where_it_is_installed(installed: Installed, tmp_path: Path) -> None:
    code = "import rclpy_simulation as kit, rclpy, mcap_files as tools; print(kit.__file__, tools.__file__)"
    files = installed.run("-c", f"{code}; print(rclpy.__file__)", cwd=tmp_path).split()
    homes = [installed.python.parents[1]] * 2 + [installed.prefix]
    assert all(Path(file).is_relative_to(home) for file, home in zip(files, homes, strict=True)), files
