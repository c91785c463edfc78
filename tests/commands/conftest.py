from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from deploy.supervision.processes import ROOT


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with the files of the set-up and of `make stop`."""
    checkout = tmp_path / "checkout"
    for name in ("requirements", "supervision", "commands", "operator"):
        ignored = shutil.ignore_patterns("__pycache__")  # other workers write there
        shutil.copytree(ROOT / "deploy" / name, checkout / "deploy" / name, ignore=ignored)
    interfaces = ("interfaces/arm_variables.py", "interfaces/plain_text.py", "interfaces/seam.py")
    for name in ("Makefile", "deploy/__init__.py", "deploy/supervisord.conf", *interfaces):
        (checkout / name).parent.mkdir(exist_ok=True)
        shutil.copyfile(ROOT / name, checkout / name)
    return checkout
