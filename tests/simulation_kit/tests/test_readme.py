"""The example of the kit's README, unchanged, with the plugin as a user loads it; and clear errors."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import rclpy_simulation

README = Path(__file__).parents[1] / "README.md"


def test_the_example_of_the_readme_passes(tmp_path: Path) -> None:
    (text,) = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    (tmp_path / "test_talker.py").write_text(text)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    options = ["--disable-plugin-autoload", "-p", "rclpy_simulation.testing", "--strict-markers", "-q"]
    command = [sys.executable, "-m", "pytest", *options]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert "1 passed" in result.stdout, result.stdout


def _error_without(module: str, tmp_path: Path) -> str:
    """Return the error of an import of the kit where a module is missing."""
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util\n"
        "real = importlib.util.find_spec\n"
        f"importlib.util.find_spec = lambda name, *more: None if name == {module!r} else real(name, *more)\n"
    )
    source = str(Path(rclpy_simulation.__path__[0]).parent)
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{source}"}
    result = subprocess.run(
        [sys.executable, "-c", "import rclpy_simulation"], env=environment, capture_output=True, text=True
    )
    return result.stderr.splitlines()[-1]


def test_a_missing_greenlet_is_a_clear_error(tmp_path: Path) -> None:
    assert _error_without("greenlet", tmp_path) == (
        "ImportError: rclpy_simulation needs greenlet: pip install 'greenlet>=3.1,<4'"
    )


def test_a_real_ros_2_is_a_clear_error(tmp_path: Path) -> None:
    error = _error_without("rclpy._dds", tmp_path)
    assert error.startswith("ImportError: rclpy_simulation needs the rclpy of rclpy-cyclonedds, not")
