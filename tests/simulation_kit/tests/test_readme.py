"""The examples of the kit's README, unchanged, with the plugin as a user loads it; and clear errors."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"


def test_the_first_example_of_the_readme_passes_and_the_second_finds_its_bug(tmp_path: Path) -> None:
    examples = re.findall(r"```python\n(.*?)```", README.read_text(), re.DOTALL)
    for example, result in zip(examples, ("1 passed", "1 failed"), strict=True):
        (tmp_path / "test_example.py").write_text(example)
        (tmp_path / "pytest.ini").write_text("[pytest]\n")
        options = ["--disable-plugin-autoload", "-p", "rclpy_simulation.testing", "--strict-markers", "-q"]
        command = [sys.executable, "-m", "pytest", *options]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert result in done.stdout, done.stdout
    assert re.search(
        r"1 of its \d+ faults is enough:\n\n.*\n    Fault\(.* kind='kill', target='watchdog'", done.stdout
    )


def _error_without(module: str, tmp_path: Path) -> str:
    """Return the error of an import of the kit where a module is missing."""
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util\n"
        "real = importlib.util.find_spec\n"
        f"importlib.util.find_spec = lambda name, *more: None if name == {module!r} else real(name, *more)\n"
    )
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    return _error_of("import rclpy_simulation", PYTHONPATH=path)


def _error_of(code: str, **environment: str) -> str:
    """Return the last line of what a program writes to standard error."""
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, env=os.environ | environment, capture_output=True, text=True)
    return result.stderr.splitlines()[-1]


def test_a_missing_greenlet_is_a_clear_error(tmp_path: Path) -> None:
    assert _error_without("greenlet", tmp_path) == (
        "ImportError: rclpy_simulation needs greenlet: pip install 'greenlet>=3.1,<4'"
    )


def test_an_rclpy_without_the_extension_is_a_clear_error(tmp_path: Path) -> None:
    (tmp_path / "rclpy").mkdir()
    (tmp_path / "rclpy" / "__init__.py").touch()
    error = _error_of(f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import rclpy_simulation")
    assert error == (
        f"ImportError: rclpy_ground needs ROS 2's own rclpy, Jazzy or Kilted: that in {tmp_path}/rclpy has no"
        " _rclpy_pybind11"
    )


def test_the_kit_wins_over_the_ground_of_the_environment() -> None:
    code = "import rclpy_simulation, rclpy.utilities as it; exit(it.get_rmw_implementation_identifier())"
    assert _error_of(code, RCLPY_GROUND="cyclonedds") == "rmw_simulation"


def test_an_import_of_rclpy_before_the_kit_is_a_clear_error() -> None:
    assert _error_of("import rclpy, rclpy_simulation") == (
        "ImportError: rclpy was imported before its ground was chosen:"
        " import rclpy_simulation or what else chooses it first"
    )


def test_a_node_outside_of_a_simulation_is_a_clear_error() -> None:
    code = "import rclpy_simulation, rclpy; rclpy.init(); rclpy.create_node('outside')"
    assert _error_of(code) == (
        "RuntimeError: no simulation runs: nodes live in programs that Simulation.start starts"
    )
