"""The packages of ``AMENT_PREFIX_PATH``, and their programs."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from ament_index_python import PackageNotFoundError, get_package_prefix, get_packages_with_prefixes


class PackageNotFound(Exception):
    def __init__(self, package_name: str) -> None:
        super().__init__(f"Package '{package_name}' not found")
        self.package_name = package_name


def get_package_names() -> Iterable[str]:
    return get_packages_with_prefixes().keys()


def get_prefix_path(package_name: str) -> str | None:
    """Return the prefix in which a package is installed; ``None`` if it is not."""
    try:
        return get_package_prefix(package_name)
    except PackageNotFoundError:
        return None


def get_executable_paths(*, package_name: str) -> list[str]:
    """Return the programs of a package, sorted. Raises PackageNotFound if there is no such package."""
    prefix = get_prefix_path(package_name)
    if prefix is None:
        raise PackageNotFound(package_name)
    directory = Path(prefix, "lib", package_name)
    return sorted(
        str(path)
        for path in directory.rglob("*")
        if path.is_file() and os.access(path, os.X_OK)
        if not any(part.startswith(".") for part in path.relative_to(directory).parent.parts)
    )
