"""Build hook: generates the type stubs of the message packages into the wheel."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class StubsHook(BuildHookInterface[Any]):
    """Adds ``<package>/<msg, srv or action>/__init__.pyi``; writes nothing into the source tree."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Generate the stubs in a process that imports this source tree, not an installed runtime."""
        self._directory = tempfile.TemporaryDirectory()
        environment = os.environ | {
            "AMENT_PREFIX_PATH": "",
            "PYTHONPATH": str(Path(self.root) / "src"),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        command = [sys.executable, "-m", "rosidl_runtime_embedded.stubs", "--output", self._directory.name]
        subprocess.run(command, env=environment, check=True)
        stubs = Path(self._directory.name)
        for path in stubs.rglob("*.pyi"):
            build_data["force_include"][str(path)] = str(path.relative_to(stubs))

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the stubs: the wheel is complete."""
        self._directory.cleanup()
