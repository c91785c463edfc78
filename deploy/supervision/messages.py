"""Messages about the end of a system."""

from __future__ import annotations

import shutil
from pathlib import Path

from deploy.supervision import processes
from deploy.supervision.run_directory import RunDirectory


def unattended(run: Path) -> str:
    """The message about services that live without supervisord."""
    return (
        f"supervisord has died; {len(processes.of_system(run))} services go on without it in {run}.\n"
        "make start replaces them, make stop ends them."
    )


def how_it_ended(run: Path) -> str:
    """The message about the end of supervisord, by a stop or by an accident."""
    return unattended(run) if RunDirectory(run).is_wanted else "The system has ended."


def silent_end(run: Path) -> str:
    """The reason of a program that gave none: perhaps it could not write one."""
    free = shutil.disk_usage(run).free
    return f"It gave no reason; {free / 1000:.0f} kB are free on the disk of {run}"
