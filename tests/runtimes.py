"""Which tests run on which ground of rclpy. A process has one, from its first import of rclpy on."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from deploy.supervision.rclpy_choice import GROUND

SIMULATED = (
    "tests/replay",
    "tests/simulation",
    "tests/simulation_kit",
)
"""Tests in virtual time: pytest runs them if it is asked for these only."""
CYCLONEDDS = (
    "deploy/ground/tests/cyclonedds",
    "deploy/ground/tests/interop",
    "tests/commands/test_fleet.py",
    "tests/security/attacks",
)
"""Tests of the ground of Cyclone DDS, and of what runs only on it."""


def needs_virtual_time(arguments: Sequence[str]) -> bool:
    """Return whether all of these files and folders have tests in virtual time."""
    return bool(arguments) and all(is_in(argument, SIMULATED) for argument in arguments)


def left_out_here(*, simulated: bool) -> tuple[str, ...]:
    """Return the files and folders whose tests cannot run in this process."""
    if os.environ.get(GROUND):
        return SIMULATED
    return CYCLONEDDS if simulated else CYCLONEDDS + SIMULATED


def is_in(path: str, folders: Iterable[str]) -> bool:
    """Return whether a path, or a test by its identifier, is in one of some folders of this checkout."""
    root = Path(__file__).resolve().parents[1]
    found = Path(root, path.partition("::")[0])
    return any(found.is_relative_to(root / folder) for folder in folders)
