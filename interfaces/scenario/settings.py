"""The settings of a service: parameters set by hand, which survive a restart.

An operator who released the switch must not find it pressed because its process was restarted.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import yaml

from interfaces.scenario import yaml_file
from interfaces.service.errors import UserError


class Settings:
    """The settings of one service, in one file."""

    def __init__(self, directory: str, service: str) -> None:
        """:param directory: the folder of the files; empty keeps nothing."""
        self._path = Path(directory) / f"{service}.yaml" if directory else None

    def read(self) -> dict[str, Any]:
        """Return the settings by name. Raises UserError for a bad file: forgetting it would not be safe."""
        if self._path is None or not self._path.exists():
            return {}
        settings = yaml_file.load(self._path)
        if not isinstance(settings, dict):
            raise UserError(f"{self._path}: contains no settings; remove it to start afresh")
        return settings

    def keep(self, name: str, value: Any) -> None:
        """Write a setting atomically. Raises UserError if that fails."""
        if self._path is not None:
            self._write(self.read() | {name: value})

    def forget(self, name: str) -> None:
        """Remove a setting. Raises UserError if that fails."""
        if self._path is not None and name in (settings := self.read()):
            del settings[name]
            self._write(settings)

    def _write(self, settings: dict[str, Any]) -> None:
        assert self._path is not None
        new = self._path.with_suffix(".new")
        try:
            self._path.parent.mkdir(exist_ok=True)
            new.write_text(yaml.safe_dump(settings), encoding="utf-8")
            os.replace(new, self._path)
        except OSError as error:
            raise UserError(f"{self._path}: {error.strerror}") from error
