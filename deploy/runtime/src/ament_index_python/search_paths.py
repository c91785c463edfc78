"""The prefixes that are searched."""

from __future__ import annotations

import os

from ament_index_python.constants import AMENT_PREFIX_PATH_ENV_VAR


def get_search_paths() -> list[str]:
    """Return the existing prefixes in AMENT_PREFIX_PATH. Raises EnvironmentError if it is unset or empty."""
    prefixes = os.environ.get(AMENT_PREFIX_PATH_ENV_VAR, "")
    if not prefixes:
        raise OSError(f"Environment variable '{AMENT_PREFIX_PATH_ENV_VAR}' is not set or empty")
    return [prefix for prefix in prefixes.split(os.pathsep) if prefix and os.path.exists(prefix)]
