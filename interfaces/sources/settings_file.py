"""The settings of a service: parameters set by hand, which survive a restart.

An operator who released the switch must not find it pressed because its process was restarted. So a process
has to know that nothing was set: the file exists from the first start on. If a later process finds no file,
the settings are lost.
"""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

import ros_yaml

from interfaces.service import yaml_file
from interfaces.service.errors import UserError


class SettingsFile:
    """The settings of one service, in one file."""

    def __init__(self, directory: str, service: str) -> None:
        """:param directory: the folder of the files; empty keeps nothing.
        :raises UserError: for a bad file: forgetting it would not be safe.
        """
        self._path = Path(directory) / f"{service}.yaml" if directory else None
        self.values: dict[str, Any] = {}
        """The settings by name; to be saved after a change."""
        if self._path is not None and self.exists:
            self._check_owner(self._path.parent)
            self.values = yaml_file.load(self._path)
            if not isinstance(self.values, dict):
                raise UserError(f"{self._path}: contains no settings; remove it to start afresh")

    @property
    def exists(self) -> bool:
        """Whether a file has what was set; nothing is lost where nothing is kept."""
        return self._path is None or self._path.exists()

    def save(self) -> None:
        """Write the file, atomically. Raises UserError if that fails; then the file is as it was."""
        if self._path is None:
            return
        text = _text(self.values)
        try:
            try:
                self._replace(self._path, text)
            except FileNotFoundError:  # a logout may empty /dev/shm (RemoveIPC of logind.conf(5))
                self._path.parent.resolve().mkdir(0o700, exist_ok=True)
                self._replace(self._path, text)
        except OSError as error:
            raise UserError(f"{self._path}: {error.strerror}") from error

    def _replace(self, path: Path, text: str) -> None:
        self._check_owner(path.parent)
        new = path.with_suffix(".new")
        with open(new, "w", encoding="utf-8") as file:
            file.write(text)
        os.replace(new, path)

    def _check_owner(self, folder: Path) -> None:
        """Raise UserError for the folder of another user, who could press the switch."""
        if os.stat(folder).st_uid != os.geteuid():
            raise UserError(f"{folder}: belongs to another user")

    def remove(self) -> None:
        """Remove the file: what it says is not true any more."""
        if self._path is not None:
            with suppress(OSError):
                self._path.unlink()


def _text(values: dict[str, Any]) -> str:
    # The time of a drive, 25 times a second: a dump would take 0.1 ms.
    if {*map(type, values.values())} == {float}:
        return "".join(f"{name}: {value!r}\n" for name, value in values.items())
    return ros_yaml.dump(values)
