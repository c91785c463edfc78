"""Resources: files of the index, each with a type and a name. The first prefix that has one wins."""

from __future__ import annotations

import os
from typing import Literal

from ament_index_python.constants import RESOURCE_INDEX_SUBFOLDER
from ament_index_python.search_paths import get_search_paths


class InvalidResourceTypeNameError(ValueError):
    """The type of a resource contains a path separator."""


class InvalidResourceNameError(ValueError):
    """The name of a resource contains a path separator."""


def _check_type(resource_type: str) -> None:
    assert resource_type, "The resource type must not be empty"
    if "/" in resource_type or "\\" in resource_type:
        raise InvalidResourceTypeNameError(f"Resource type '{resource_type}' is invalid")


def _check_name(resource_name: str) -> None:
    assert resource_name, "The resource name must not be empty"
    if "/" in resource_name or "\\" in resource_name:
        raise InvalidResourceNameError(f"Resource name '{resource_name}' is invalid")


def get_resource(resource_type: str, resource_name: str) -> tuple[str, str]:
    """Return the content of a resource and its prefix.

    :raises LookupError: if no prefix has it.
    :raises OSError: if it cannot be read, or AMENT_PREFIX_PATH is unset.
    :raises InvalidResourceTypeNameError, InvalidResourceNameError: if a name has a path separator.
    """
    prefix = has_resource(resource_type, resource_name)
    if prefix is False:
        raise LookupError(f"Could not find the resource '{resource_name}' of type '{resource_type}'")
    try:
        with open(os.path.join(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type, resource_name)) as file:
            return file.read(), prefix
    except OSError as error:
        raise OSError(
            f"Could not open the resource '{resource_name}' of type '{resource_type}':\n{error}"
        ) from None


def has_resource(resource_type: str, resource_name: str) -> str | Literal[False]:
    """Return the prefix of a resource, or ``False``. Raises as `get_resource`, except for LookupError."""
    _check_type(resource_type)
    _check_name(resource_name)
    for prefix in get_search_paths():
        if os.path.isfile(os.path.join(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type, resource_name)):
            return prefix
    return False


def get_resources(resource_type: str) -> dict[str, str]:
    """Return the names of all resources of a type, with their prefixes."""
    _check_type(resource_type)
    found: dict[str, str] = {}
    for prefix in get_search_paths():
        for entry in _visible(os.path.join(prefix, RESOURCE_INDEX_SUBFOLDER, resource_type)):
            if not entry.is_dir():
                found.setdefault(entry.name, prefix)
    return found


def get_resource_types() -> set[str]:
    """Return the types of resources in all prefixes."""
    directories = (os.path.join(prefix, RESOURCE_INDEX_SUBFOLDER) for prefix in get_search_paths())
    return {entry.name for directory in directories for entry in _visible(directory) if entry.is_dir()}


def _visible(directory: str) -> list[os.DirEntry[str]]:
    if not os.path.isdir(directory):
        return []
    return [entry for entry in os.scandir(directory) if not entry.name.startswith(".")]
