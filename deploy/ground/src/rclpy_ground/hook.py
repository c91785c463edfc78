"""Chooses the ground that the environment variable ``RCLPY_GROUND`` names, when rclpy is first imported.

A ``.pth`` file of the environment imports this module where the variable is set, so programs need no change.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

VARIABLE = "RCLPY_GROUND"
CYCLONEDDS = "cyclonedds"


class Chooser:
    """A finder of modules that finds none: it notices the import of rclpy.

    A program that chooses a ground itself removes it.
    """

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        genuine = sys.modules.get("rclpy_ground.genuine")
        is_search = genuine is not None and not hasattr(genuine, "PATH")  # it looks for the extension
        if name == "rclpy" and not is_search:
            sys.meta_path.remove(self)
            _choose(os.environ.get(VARIABLE, ""))
        return None


def _choose(name: str) -> None:
    from rclpy_ground import install
    from rclpy_ground.cyclonedds import CycloneDDS

    if name != CYCLONEDDS:
        raise ImportError(f"{VARIABLE}={name}: it is {CYCLONEDDS}, or empty for the middleware of ROS 2")
    os.environ.pop("RMW_IMPLEMENTATION", None)  # rcl would load it to parse arguments
    install(CycloneDDS())


if os.environ.get(VARIABLE):
    sys.meta_path.insert(0, Chooser())
