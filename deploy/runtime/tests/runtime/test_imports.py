from __future__ import annotations

import subprocess
import sys

import pytest


@pytest.mark.parametrize("module", ["rclpy", "rclpy.node", "rclpy.action"])
def test_programs_without_arrays_do_not_load_numpy(module: str) -> None:
    program = f"import {module}, sys; print('numpy' in sys.modules)"
    found = subprocess.check_output([sys.executable, "-c", program], text=True, timeout=30)
    assert found == "False\n"
