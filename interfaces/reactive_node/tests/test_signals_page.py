"""The problems of SIGNALS.md run as they stand."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

PROJECT = Path(__file__).parents[1]
PAGE = (PROJECT / "SIGNALS.md").read_text(encoding="utf-8")
FILES = re.findall(r"^```python\n# (\w+\.py)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)


@pytest.fixture
def files(tmp_path: Path) -> Path:
    for name, content in FILES:
        (tmp_path / name).write_text(content)
    (tmp_path / "conftest.py").write_text('pytest_plugins = ["reactive_node.testing"]\n')
    return tmp_path


def test_problems_run_as_tests(files: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--rootdir={files}", files]
    environment = os.environ | {"PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}

    run = subprocess.run(command, cwd=files, env=environment, capture_output=True, text=True)

    assert run.returncode == 0, run.stdout
    assert run.stdout.splitlines()[-1].startswith("3 passed")
