"""Reads and checks a user's parameter file, in the form of ROS 2 (interfaces/README.md).

`/**` stands for all services that have the parameter. The services of an arm in a namespace may be named with
the namespace or without.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from types import ModuleType
from typing import Any

from deploy.supervision import interruption, manifest
from deploy.supervision.reaction import Reaction, reaction
from deploy.supervision.run_directory import ALL, KEY
from interfaces.service import UserError, yaml_file
from interfaces.service.parameters import Declaration, declarations

USE_SIM_TIME = Declaration("use_sim_time", False, None, "", "whether time is simulated", False)


def load(path: str, namespace: str) -> dict[str, Any]:
    """Return the content of a file, with the full name of each node: ROS applies no other in a namespace.

    :raises UserError: for errors: a line for each, with file, key and reason.
    """
    with interruption.blocking():  # the file may be a silent pipe
        document = yaml_file.load(path) or {}
    if found := [f"{path}: {key}: {problem}" for key, problem in problems(document, namespace)]:
        raise UserError("\n".join(found))
    try:
        reaction_to(document, namespace).check()
    except UserError as error:
        raise UserError(f"{path}: {error}") from None
    prefix = namespace.rstrip("/") + "/"
    return {
        node if node == ALL else prefix + _program_of(node, namespace): document[node] for node in document
    }


def reaction_to(document: Mapping[str, Any], namespace: str) -> Reaction:
    """Return the reaction of an arm whose services start with the content of a parameter file."""
    shared = document.get(ALL, {}).get(KEY, {})
    given = {_program_of(node, namespace): content[KEY] for node, content in document.items()}
    # The names are enough: an import of a user's program may fail, or open its device a second time.
    return reaction({each.name: shared | given.get(each.name, {}) for each in manifest.everywhere()})


def declared() -> dict[str, dict[str, Declaration]]:
    """Return the parameters that a user may set, by program of the manifest and by name.

    :raises UserError: if a program cannot be imported.
    """
    return {program.name: _declared_by(program) for program in manifest.everywhere()}


def _declared_by(program: manifest.Program) -> dict[str, Declaration]:
    parameters = getattr(_imported(program.module), "Parameters", None)
    if isinstance(parameters, Mapping):  # one module serves several programs
        parameters = next((parameters[word] for word in program.arguments if word in parameters), None)
    found = declarations(parameters) if parameters else ()
    return {each.name: each for each in (*found, USE_SIM_TIME)}


def _imported(module: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except (Exception, SystemExit) as error:  # whatever a user's module does
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
        raise UserError(f"{module}: cannot be imported: {reason}") from None


def problems(document: Any, namespace: str) -> Iterator[tuple[str, str]]:
    """Yield the errors in the parameter file of an arm: the key and the reason of each."""
    services = declared()
    names = ", ".join([*services, ALL])
    if not isinstance(document, dict):
        yield "file", f"must name services, of {names}"
        return
    seen: dict[str, Any] = {}
    for node, content in document.items():
        program = _program_of(str(node), namespace)
        if seen.setdefault(program, node) != node:
            yield node, f"is the service that the file also names {seen[program]}"
        if program not in services and node != ALL:
            yield node, f"is no service; the services are {names}"
        elif not isinstance(content, dict) or [*content] != [KEY] or not isinstance(content[KEY], dict):
            yield node, f"must hold {KEY}, which holds the parameters"
        else:
            concerned = services if node == ALL else {program: services[program]}
            for name, value in content[KEY].items():
                yield from _problems_of(node, name, value, concerned)


def _problems_of(
    node: str, name: str, value: object, services: dict[str, dict[str, Declaration]]
) -> Iterator[tuple[str, str]]:
    having = {service: known[name] for service, known in services.items() if name in known}
    if not having:
        known = dict.fromkeys(name for parameters in services.values() for name in parameters)
        yield f"{node}.{name}", f"is no parameter; the parameters are {', '.join(known)}"
    for service, declaration in having.items():
        if problem := declaration.problem(value):
            key = f"{node}.{name} of {service}" if node == ALL else f"{node}.{name}"
            yield key, problem


def _program_of(node: str, namespace: str) -> str:
    """The program of a node that is named with the arm's namespace or without."""
    return node.removeprefix(namespace.rstrip("/") + "/")
