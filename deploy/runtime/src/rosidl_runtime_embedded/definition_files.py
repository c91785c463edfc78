"""Finds the definition files of message packages, and reads each file once.

A message package is a directory with ``msg/*.msg``, ``srv/*.srv`` and ``action/*.action``. The packages of
this distribution are the directories next to this one. Packages of users are in ``<prefix>/share/<package>``,
for every prefix in ``AMENT_PREFIX_PATH``. A package of this distribution wins over a user's package of the
same name.
"""

from __future__ import annotations

import os
from functools import cache
from typing import TYPE_CHECKING

from .definition import (
    ActionDefinition,
    InvalidDefinition,
    MessageDefinition,
    ServiceDefinition,
    parse_action,
    parse_message,
    parse_service,
)

if TYPE_CHECKING:
    from collections.abc import Iterator

_SHIPPED = os.path.dirname(os.path.dirname(__file__))
KINDS = ("msg", "srv", "action")
"""The directories of definition files, which are also the suffixes of the files."""
SERVICE_PARTS = ("Request", "Response", "Event")
_ACTION_MESSAGES = {
    "Goal": "goal",
    "Result": "result",
    "Feedback": "feedback",
    "FeedbackMessage": "feedback_message",
}
ACTION_SERVICES = {"SendGoal": "send_goal", "GetResult": "get_result"}
ACTION_PARTS = (
    *_ACTION_MESSAGES,
    *(f"{service}_{part}" for service in ACTION_SERVICES for part in SERVICE_PARTS),
)
"""The messages that an action defines."""


def _directories(package: str) -> Iterator[str]:
    yield os.path.join(_SHIPPED, package)
    for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if prefix:
            yield os.path.join(prefix, "share", package)


def _file(name: str) -> str | None:
    package, kind, type_name = name.split("/")
    paths = (os.path.join(directory, kind, f"{type_name}.{kind}") for directory in _directories(package))
    return next(filter(os.path.isfile, paths), None)


def shipped_packages() -> list[str]:
    """Names of the message packages of this distribution, sorted."""
    names = [entry.name for entry in os.scandir(_SHIPPED) if entry.is_dir()]
    return sorted(name for name in names if any(interface_names(name, kind) for kind in KINDS))


def interface_names(package: str, kind: str) -> list[str]:
    """Names of all messages, services or actions (see KINDS) that a package defines, sorted."""
    directories = filter(
        os.path.isdir, (os.path.join(directory, kind) for directory in _directories(package))
    )
    files = {file for directory in directories for file in os.listdir(directory)}
    return sorted(file.removesuffix(f".{kind}") for file in files if file.endswith(f".{kind}"))


@cache
def definition_source(name: str) -> tuple[str, str]:
    """File and text that define ``<package>/<kind>/<Name>``. Raises LookupError or InvalidDefinition.

    Cached, because a type in use stays the same when its file changes.
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
    return _file(name) is not None


@cache
def action_definition(name: str) -> ActionDefinition:
    """Definition of an action by its full name. Raises LookupError or InvalidDefinition."""
    path, text = definition_source(name)
    return parse_action(name, text, path, is_defined)


@cache
def service_definition(name: str) -> ServiceDefinition:
    """Definition of a service, or an action's, by full name. Raises LookupError or InvalidDefinition."""
    if "/action/" in name:
        action, _, service = name.rpartition("_")
        if service not in ACTION_SERVICES:
            raise LookupError(f"{name} is not a service")
        definition: ServiceDefinition = getattr(action_definition(action), ACTION_SERVICES[service])
        return definition
    path, text = definition_source(name)
    return parse_service(name, text, path, is_defined)


@cache
def message_definition(name: str) -> MessageDefinition:
    """Definition of a message, or of one in a service or action. Raises LookupError or InvalidDefinition."""
    if "/msg/" in name:
        path, text = definition_source(name)
        return parse_message(name, text, path, is_defined)
    owner, _, part = name.rpartition("_")
    if "/action/" in name and part in _ACTION_MESSAGES:
        definition: MessageDefinition = getattr(action_definition(owner), _ACTION_MESSAGES[part])
    elif part in SERVICE_PARTS:
        definition = getattr(service_definition(owner), part.lower())
    else:
        raise LookupError(f"{name} is not a message")
    return definition
