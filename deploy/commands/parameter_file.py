"""Checks a user's parameter file before anything starts. It has the form of ROS 2::

    operator_watchdog:
      ros__parameters:
        silence: 2.0

with `/**` for all services that have the parameter; an arm in a namespace may name its services with it, or
without. This is done in a process of its own, which the launcher can end wherever it is: what the user names
may be a pipe or a device that never says anything.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from deploy.commands.parameters import ALL, KEY, program_of
from deploy.supervision import sentinel
from deploy.supervision.system import namespace_of
from interfaces import topics
from interfaces.scenario import unique_yaml
from services import (
    config_publisher,
    dead_mans_switch,
    engine_controller,
    kinematics,
    operator_watchdog,
    velocity,
)

KINDS = {bool: "true or false", int: "an integer", float: "a number with a decimal point", str: "a string"}

WIRES: dict[str, Callable[[Any], None]] = {
    **{f"config_{name}": partial(config_publisher.wire, topic=t) for name, t in topics.CONFIGURATION.items()},
    "dead_mans_switch": dead_mans_switch.wire,
    "kinematics": kinematics.wire,
    "velocity": velocity.wire,
    "operator_watchdog": operator_watchdog.wire,
    "engine_controller": engine_controller.wire,
    "sentinel": sentinel.wire,
}


class Declared(NamedTuple):
    """A parameter as a service declares it."""

    default: Any
    within: tuple[Any, Any] | None
    """the least and the greatest value that are allowed"""

    def fault(self, value: object) -> str:
        """What is wrong with a value, in words; '' for a good one."""
        if type(value) is not type(self.default):
            return f"must be {KINDS[type(self.default)]}, not {value!r}"
        if self.within and not self.within[0] <= value <= self.within[1]:
            return f"must be from {self.within[0]:g} to {self.within[1]:g}, not {value!r}"
        return ""


def declared() -> dict[str, dict[str, Declared]]:
    """The parameters of each service that a user may set."""
    return {name: _Declarations(wire).parameters for name, wire in WIRES.items()}


def faults(document: Any, namespace: str) -> Iterator[tuple[str, str]]:
    """The mistakes in the parameter file of an arm: the key at which each stands, and the reason."""
    services = declared()
    names = ", ".join([*services, ALL])
    if not isinstance(document, dict):
        yield "file", f"must name services, of {names}"
        return
    for node, content in document.items():
        program = program_of(str(node), namespace)
        if program not in services and node != ALL:
            yield node, f"is no service; those are {names}"
        elif not isinstance(content, dict) or [*content] != [KEY] or not isinstance(content[KEY], dict):
            yield node, f"must hold {KEY}, and that its parameters"
        else:
            for name, value in content[KEY].items():
                concerned = [*services.values()] if node == ALL else [services[program]]
                if fault := _fault(name, value, concerned):
                    yield f"{node}.{name}", fault


def _fault(name: str, value: object, services: list[dict[str, Declared]]) -> str:
    """What is wrong with a parameter for one of the services that have it, in words; '' for a good one."""
    having = [parameters[name] for parameters in services if name in parameters]
    if not having:
        known = dict.fromkeys(name for parameters in services for name in parameters)
        return f"is no parameter; those are {', '.join(known)}"
    return next(filter(None, (declared.fault(value) for declared in having)), "")


class _Declarations:
    """Stands for the node while a service wires itself, until it has declared its parameters."""

    class _AllDeclared(Exception):
        pass

    def __init__(self, wire: Callable[[Any], None]) -> None:
        self.parameters = {"use_sim_time": Declared(False, None)}
        with suppress(self._AllDeclared):
            wire(self)

    def declare(
        self, name: str, default: Any, within: Any, description: str, *, settable: bool = False
    ) -> Any:
        self.parameters[name] = Declared(default, within)
        return default

    def declare_scenario(self) -> None:
        """The scenario and its origin are none of the user's parameters."""
        raise self._AllDeclared

    def __getattr__(self, name: str) -> Any:
        raise self._AllDeclared


def main(path: str) -> str | None:
    """Print what a good file says, as JSON; the first mistake of another, with file, key and reason."""
    try:
        document = unique_yaml.load(Path(path).read_text(encoding="utf-8"))
    except OSError as error:
        return f"{path}: {error.strerror}"
    except (ValueError, yaml.YAMLError) as error:  # the former also of a date that does not exist
        return f"{path}: {' '.join(str(error).split())}"
    for key, fault in faults(document, namespace_of(os.environ)):
        return f"{path}: {key}: {fault}"
    print(json.dumps(document))
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
