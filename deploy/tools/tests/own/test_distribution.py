"""The tools as a distribution: its wheel has everything, and brings no rclpy."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytestmark = pytest.mark.own

TOOLS = Path(__file__).parents[2]


def test_wheel_has_the_sources_and_the_command(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=TOOLS, check=True, stdout=subprocess.DEVNULL, timeout=60)
    (wheel,) = tmp_path.glob("ros2_python_tools-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        files = {name for name in archive.namelist() if ".dist-info/" not in name}
        (commands,) = (name for name in archive.namelist() if name.endswith("/entry_points.txt"))
        assert "ros2 = ros2cli.cli:main" in archive.read(commands).decode()
    source = TOOLS / "src"
    sources = {str(path.relative_to(source)) for path in source.rglob("*") if path.is_file()}
    assert files == {name for name in sources if "__pycache__" not in name}
    assert {f"{name.partition('/')[0]}/py.typed" for name in files} <= files
