"""The messages that a page sends, parsed and checked: JSON objects with a ``type``, and nothing else.

Everything outside this protocol raises :class:`ProtocolError`; the server then closes the connection.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from typing import Any, NamedTuple

from deploy.supervision import manifest
from interfaces.service.parameters import declarations
from interfaces.topics import TURN_OFF, TURN_ON
from services.config_publisher import Parameters

MAX_SIZE = 1024  # bytes of a message
MAX_WORD = 64  # characters of a token or nonce
ACTIONS = ("kill", "stop")


class ProtocolError(Exception):
    """A message is outside the protocol."""


class Hello(NamedTuple):
    token: str


class Press(NamedTuple):
    nonce: str


class Beat(NamedTuple):
    nonce: str


class Release(NamedTuple):
    """The button is released."""


class Engines(NamedTuple):
    command: str


class Set(NamedTuple):
    """A value for one source of the configuration [m or rad]."""

    name: str
    value: float


class FollowScenario(NamedTuple):
    """The sources of the configuration return to the scenario."""


class Process(NamedTuple):
    """Kill (SIGKILL) or stop (SIGSTOP) the process of a program."""

    name: str
    action: str


class Fault(NamedTuple):
    """An error of the page's own code."""

    text: str


Message = Hello | Press | Beat | Release | Engines | Set | FollowScenario | Process | Fault


PROGRAMS = tuple(program.name for program in manifest.everywhere())


def _limits() -> dict[str, tuple[float, float]]:
    limits = {}
    for name, parameters in Parameters.items():
        if f"config_{name}" not in PROGRAMS:  # a real joint
            continue
        (value,) = (each for each in declarations(parameters) if each.name == "value")
        assert value.within is not None
        limits[name] = value.within
    return limits


LIMITS: Mapping[str, tuple[float, float]] = _limits()
"""The least and the greatest value of each source that runs [m or rad]."""


def parse(text: str | bytes) -> Message:
    """Return the message that a page has sent. Raises ProtocolError if no page sends such a message."""
    if not isinstance(text, str):
        raise ProtocolError("a message is binary")
    if len(text) > MAX_SIZE:
        raise ProtocolError("a message is too long")
    try:
        fields = json.loads(text, object_pairs_hook=_object)
    except (ValueError, RecursionError):
        raise ProtocolError("a message is not valid JSON") from None
    kind = fields.pop("type", None) if isinstance(fields, dict) else None
    if not isinstance(kind, str) or kind not in _MESSAGES:
        raise ProtocolError("a message has no known type")
    message, checks = _MESSAGES[kind]
    if fields.keys() != checks.keys():
        raise ProtocolError(f"{kind} has wrong fields")
    for name, check in checks.items():
        if not check(fields[name]):
            raise ProtocolError(f"{kind} has a wrong {name}")
    if message is Set:
        least, greatest = LIMITS[fields["name"]]
        if not least <= fields["value"] <= greatest:  # nor a NaN, which json accepts
            raise ProtocolError(f"{kind} has a value out of range")
        return Set(fields["name"], float(fields["value"]))
    return message(**fields)


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields = dict(pairs)
    if len(fields) != len(pairs):
        raise ValueError("a key stands twice")
    return fields


def _is_word(value: object) -> bool:
    return isinstance(value, str) and len(value) <= MAX_WORD and value.isascii()


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _one_of(known: Collection[str]) -> Callable[[object], bool]:
    return lambda value: isinstance(value, str) and value in known


_MESSAGES: dict[str, tuple[Callable[..., Message], dict[str, Callable[[object], bool]]]] = {
    "hello": (Hello, {"token": _is_word}),
    "press": (Press, {"nonce": _is_word}),
    "beat": (Beat, {"nonce": _is_word}),
    "release": (Release, {}),
    "engines": (Engines, {"command": _one_of((TURN_ON, TURN_OFF))}),
    "set": (Set, {"name": _one_of(LIMITS), "value": _is_number}),
    "follow_scenario": (FollowScenario, {}),
    "fault": (Fault, {"text": lambda it: isinstance(it, str)}),
    "process": (Process, {"name": _one_of(PROGRAMS), "action": _one_of(ACTIONS)}),
}
