"""What was set by hand, kept for the process that comes after a service's death.

Who has released the switch must not find it pressed again because its process was restarted.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml

from interfaces.scenario import yaml_file
from interfaces.service.errors import UserError


class Settings:
    """The parameters of one service that were set by hand, in a file of its own."""

    def __init__(self, directory: str, service: str) -> None:
        """:param directory: where the files lie, empty where nothing is to be kept."""
        self._path = Path(directory) / f"{service}.yaml" if directory else None

    def read(self) -> dict[str, Any]:
        """Return what was set, by name. Raises UserError: to forget it would not be safe."""
        if self._path is None or not self._path.exists():
            return {}
        settings = yaml_file.load(self._path)
        if not isinstance(settings, dict):
            raise UserError(f"{self._path}: holds no settings; remove it to begin anew")
        return settings

    def keep(self, name: str, value: Any) -> None:
        """Keep a value, all of it or nothing. Raises UserError if that is not possible."""
        if self._path is None:
            return
        settings = self.read() | {name: value}
        new = self._path.with_suffix(".new")
        try:
            self._path.parent.mkdir(exist_ok=True)
            new.write_text(yaml.safe_dump(settings), encoding="utf-8")
            os.replace(new, self._path)
        except OSError as error:
            raise UserError(f"{self._path}: {error.strerror}") from error
