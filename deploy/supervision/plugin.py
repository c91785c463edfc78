"""The plugin that supervisord.conf names: supervisord imports it while it reads its configuration.

`supervisord -c deploy/supervisord.conf`, typed by hand, knows nothing of run directory, environment and
parameters. This import prepares them as `make start` does, and replaces supervisord by one that has them.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from deploy.supervision import manifest, processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.extension import make_interface, make_main_interface
from deploy.supervision.run_directory import LEAD, scenario_parameters
from deploy.supervision.system import System

__all__ = ["make_interface", "make_main_interface"]

SCENARIO = processes.ROOT / "deploy" / "scenarios" / "demo.yaml"  # as `make start`


def start_by_hand(arguments: list[str]) -> None:
    """Replace this process by a supervisord with the same arguments that runs the system."""
    parameters = scenario_parameters(SCENARIO, time.monotonic() + LEAD)  # `make start` waits instead
    try:
        System().become_supervisord(parameters, [_absolute(word) for word in arguments])
    except (DeploymentError, OSError) as error:
        sys.exit(str(error))


def _absolute(word: str) -> str:
    """Make the path of the manifest absolute: supervisord will work in the run directory."""
    option, equals, path = word.rpartition("=")  # --configuration=deploy/supervisord.conf
    is_manifest = Path(path).exists() and os.path.samefile(path, manifest.PATH)
    return f"{option}{equals}{manifest.PATH}" if is_manifest else word


if Path(sys.argv[0]).stem == "supervisord" and processes.MARK not in os.environ:
    start_by_hand(sys.argv[1:])
