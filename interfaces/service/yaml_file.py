"""Reads YAML files that users write, by the rules of ROS 2's parameter files (:mod:`ros_yaml`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import ros_yaml

from interfaces.service.errors import UserError


def load(path: str | Path) -> Any:
    """Return the content of a file. Raises UserError, one line with file and position, if that fails."""
    try:
        return ros_yaml.read(path)
    except OSError as error:
        raise UserError(f"{path}: {error.strerror}") from error
    except ros_yaml.YamlError as error:
        raise UserError(f"{path}: {error}") from error
