"""Finds the definition files of message packages, and reads each one once.

A message package is a directory with ``msg/*.msg`` and ``srv/*.srv`` in it. The packages of this distribution
lie beside this one; those of a user in ``<prefix>/share/<package>`` for a prefix of ``AMENT_PREFIX_PATH``.
The former win.
"""

from __future__ import annotations

import os
from functools import cache
from typing import TYPE_CHECKING

from .definition import InvalidDefinition, MessageDefinition, ServiceDefinition, parse_message, parse_service

if TYPE_CHECKING:
    from collections.abc import Iterator

_SHIPPED = os.path.dirname(os.path.dirname(__file__))
SERVICE_PARTS = ("Request", "Response", "Event")


def _directories(package: str) -> Iterator[str]:
    yield os.path.join(_SHIPPED, package)
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield os.path.join(prefix, "share", package)


def _file(name: str) -> str | None:
    package, kind, type_name = name.split("/")
    paths = (os.path.join(directory, kind, f"{type_name}.{kind}") for directory in _directories(package))
    return next(filter(os.path.isfile, paths), None)


def interface_names(package: str, kind: str) -> list[str]:
    """Names of all messages (kind ``msg``) or services (``srv``) that a package defines, sorted."""
    directories = filter(
        os.path.isdir, (os.path.join(directory, kind) for directory in _directories(package))
    )
    files = {file for directory in directories for file in os.listdir(directory)}
    return sorted(file.removesuffix(f".{kind}") for file in files if file.endswith(f".{kind}"))


@cache
def definition_source(name: str) -> tuple[str, str]:
    """File and text that define ``<package>/<msg or srv>/<Name>``. Raises LookupError or InvalidDefinition.

    Kept in memory: the file of a type in use may change, and the type does not.
    """
    path = _file(name)
    if path is None:
        raise LookupError(f"there is no definition of {name}")
    with open(path, encoding="utf-8") as file:
        try:
            return path, file.read()
        except UnicodeDecodeError as error:
            raise InvalidDefinition(f"{path}:1: the file is not UTF-8: {error}") from None


def is_defined(name: str) -> bool:
    """Whether there is a definition file of ``<package>/<msg or srv>/<Name>``."""
    return _file(name) is not None


@cache
def service_definition(name: str) -> ServiceDefinition:
    """Definition of a service by its full name. Raises LookupError or InvalidDefinition."""
    path, text = definition_source(name)
    return parse_service(name, text, path, is_defined)


@cache
def message_definition(name: str) -> MessageDefinition:
    """Definition of a message or a service's part by full name. Raises LookupError or InvalidDefinition."""
    if "/srv/" in name:
        service, _, part = name.rpartition("_")
        if part not in SERVICE_PARTS:
            raise LookupError(f"{name} is no message")
        definition: MessageDefinition = getattr(service_definition(service), part.lower())
        return definition
    path, text = definition_source(name)
    return parse_message(name, text, path, is_defined)
