"""Packages: resources of the type ``packages``."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

from ament_index_python.resources import get_resources, has_resource
from ament_index_python.search_paths import get_search_paths


class PackageNotFoundError(KeyError):
    """No prefix has the package."""


def get_packages_with_prefixes() -> dict[str, str]:
    """Return the names of all packages, with their prefixes."""
    return get_resources("packages")


def get_package_prefix(package_name: str) -> str:
    """Return a package's prefix. Raises PackageNotFoundError, or ValueError for a bad name (REP 127)."""
    if not re.fullmatch("[a-zA-Z0-9][a-zA-Z0-9_-]+", package_name, re.ASCII):
        raise ValueError(f"'{package_name}' is not a valid package name")
    prefix = has_resource("packages", package_name)
    if prefix is False:
        raise PackageNotFoundError(f"package '{package_name}' not found, searching: {get_search_paths()}")
    return prefix


def get_package_share_directory(package_name: str, print_warning: bool = True) -> str:
    """Return ``<prefix>/share/<package>``; warn if it does not exist. Raises as `get_package_prefix`."""
    path = get_package_share_path(package_name, print_warning=False)
    if print_warning and not path.exists():
        warnings.warn(f"Share directory for {package_name} ({path}) does not exist.", stacklevel=2)
    return str(path)


def get_package_share_path(package_name: str, print_warning: bool = True) -> Path:
    """Return ``<prefix>/share/<package>`` as a path; warn if it does not exist."""
    path = Path(get_package_prefix(package_name), "share", package_name)
    if print_warning and not path.exists():
        warnings.warn(f"Share path for {package_name} ({path}) does not exist.", stacklevel=2)
    return path
