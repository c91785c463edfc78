from __future__ import annotations

import subprocess
import sys

PROGRAM = """
from rosidl_runtime_embedded import generated
try:
    generated.run("raise KeyboardInterrupt", {})
except KeyboardInterrupt:
    pass
"""


def test_program_continues_after_a_ctrl_c_caught_in_generated_code() -> None:
    assert subprocess.run([sys.executable, "-c", PROGRAM], timeout=30).returncode == 0
