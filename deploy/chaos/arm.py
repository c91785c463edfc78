"""An arm under test: its system, and where the faults find its processes."""

from __future__ import annotations

import time
from contextlib import suppress

from deploy.supervision.system import DeploymentError, System

PID_TIMEOUT = 2.0  # s to wait for a program that is being restarted


class Arm:
    """An arm into which faults are injected."""

    def __init__(self, namespace: str, system: System) -> None:
        self.namespace = namespace
        self.system = system
        self.domain = 0  # ROS_DOMAIN_ID
        self._environment: dict[str, str] = {}

    def pid(self, program: str) -> int:
        """Return the process of a program, or 0. Waits for a program that is being restarted."""
        deadline = time.monotonic() + PID_TIMEOUT
        while True:
            with suppress(DeploymentError):
                for each in self.system.programs():
                    if each.name == program and each.state == "RUNNING":
                        return each.pid
            if time.monotonic() > deadline:
                # supervisord may be dead; its programs live on.
                return next((p.pid for p in self.system.members() if p.program == program), 0)
            time.sleep(0.02)

    def environment(self) -> dict[str, str]:
        """Return the environment of the arm's processes; the last known one if none is alive."""
        self._environment = self.system.environment() or self._environment
        return self._environment


def file_suffix(namespace: str) -> str:
    """Return the end of an arm's file names: empty in the root namespace, ``_arm1`` in ``/arm1``."""
    return namespace.replace("/", "_").rstrip("_")
