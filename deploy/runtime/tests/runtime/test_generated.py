"""How generated code is run."""

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


def test_a_program_that_has_caught_a_ctrl_c_within_generated_code_does_not_end_by_it() -> None:
    assert subprocess.run([sys.executable, "-c", PROGRAM], timeout=30).returncode == 0
