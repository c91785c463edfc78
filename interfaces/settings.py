"""What was set by hand, kept for the process that comes after a service's death.

Who has released the switch must not find it pressed again because its process was restarted.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml


class Settings:
    """The parameters of one service that were set by hand, in a file of its own."""

    def __init__(self, directory: str, service: str) -> None:
        """:param directory: where the files lie, empty where nothing is to be kept."""
        self._path = Path(directory) / f"{service}.yaml" if directory else None

    def read(self) -> dict[str, Any]:
        """Return what was set, by name."""
        if self._path is None or not self._path.exists():
            return {}
        return dict(yaml.safe_load(self._path.read_text(encoding="utf-8")))

    def keep(self, name: str, value: Any) -> None:
        """Keep a value, all of it or nothing. Raises OSError if that is not possible."""
        if self._path is None:
            return
        self._path.parent.mkdir(exist_ok=True)
        new = self._path.with_suffix(".new")
        new.write_text(yaml.safe_dump(self.read() | {name: value}), encoding="utf-8")
        os.replace(new, self._path)
