"""Tests of rclpy's behaviour, which pass on ROS 2 too, within a simulated process: in virtual time."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

CONFORMANCE = Path(__file__).parents[3] / "deploy" / "ground" / "tests" / "conformance"
NAMES = ("between_nodes", "events", "executors", "lifecycle", "services", "timers")


def main() -> None:
    from rclpy_simulation import Simulation

    files = [str(CONFORMANCE / f"test_{name}.py") for name in NAMES]
    no_timeouts = ["-o", "timeout=0", "-o", "faulthandler_timeout=0"]
    options = ["-p", "no:cacheprovider", *no_timeouts, "--capture=sys", "-q"]
    with Simulation(seed=1) as simulation:
        process = simulation.start(lambda: sys.exit(pytest.main([*options, *files])), name="pytest")
        simulation.run_until(lambda: process.ended, 3600.0)
    print(process.output.text)
    sys.exit(process.exit_code)


def test_conformance_holds_in_a_simulated_process() -> None:
    command = [sys.executable, "-m", "tests.simulation_kit.tests.test_conformance"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr


if __name__ == "__main__":
    main()
