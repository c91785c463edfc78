"""Checks a user's parameter file before anything starts. It has the form of ROS 2::

    operator_watchdog:
      ros__parameters:
        silence: 2.0

with `/**` for all services that have the parameter; an arm in a namespace may name its services with it, or
without. This is done in a process of its own, which the launcher can end wherever it is: what the user names
may be a pipe or a device that never says anything.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
from collections.abc import Iterator
from typing import Any

from deploy.commands.parameters import ALL, KEY, program_of
from deploy.supervision import manifest
from deploy.supervision.system import namespace_of
from interfaces.scenario import yaml_file
from interfaces.service import UserError
from interfaces.service.parameters import Declaration, declarations

USE_SIM_TIME = Declaration("use_sim_time", False, None, "", "whether time is simulated", False)


def declared() -> dict[str, dict[str, Declaration]]:
    """Return the parameters that a user may set, by program of the manifest and by name."""
    return {program.name: _declared_by(program) for program in manifest.programs()}


def _declared_by(program: manifest.Program) -> dict[str, Declaration]:
    parameters = getattr(importlib.import_module(program.module), "Parameters", None)
    if parameters and program.arguments:  # one module serves several programs
        parameters = parameters[program.arguments[0]]
    found = declarations(parameters) if parameters else ()
    return {each.name: each for each in (*found, USE_SIM_TIME)}


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


def _fault(name: str, value: object, services: list[dict[str, Declaration]]) -> str:
    """What is wrong with a parameter for one of the services that have it, in words; '' for a good one."""
    having = [parameters[name] for parameters in services if name in parameters]
    if not having:
        known = dict.fromkeys(name for parameters in services for name in parameters)
        return f"is no parameter; those are {', '.join(known)}"
    return next(filter(None, (declaration.problem(value) for declaration in having)), "")


def main(path: str) -> str | None:
    """Print what a good file says, as JSON; the first mistake of another, with file, key and reason."""
    try:
        document = yaml_file.load(path)
    except UserError as error:
        return str(error)
    for key, fault in faults(document, namespace_of(os.environ)):
        return f"{path}: {key}: {fault}"
    print(json.dumps(document))
    return None


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
