from __future__ import annotations

import subprocess
import sys


def test_node_without_actions_does_not_import_them() -> None:
    program = "import reactive_node, sys; print([name for name in sys.modules if 'rclpy.action' in name])"

    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)

    assert run.stdout == "[]\n"
