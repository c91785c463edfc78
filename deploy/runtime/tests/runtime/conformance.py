"""Compares the embedded runtime with the public API of ROS 2's rclpy: the table of deploy/runtime/README.md.

``python -m deploy.runtime.tests.runtime.conformance``, run from the root of the repository, prints it. The
wheels of ROS 2 tell their API: classes, functions and signatures (api.py). A name is *supported* if this
runtime accepts the calls that rclpy accepts: its parameters have the same names, kinds and order, and the
same ones have a default.
"""

from __future__ import annotations

import ast
import importlib
import importlib.util
import inspect
import json
import subprocess
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from inspect import Parameter
from pathlib import Path
from typing import Any

from deploy.runtime.tests.interop.processes import environment, python

ABSTRACT = {
    "CallbackGroup": ("beginning_execution", "can_execute", "ending_execution"),
    "Executor": ("spin_once", "spin_once_until_future_complete"),
    "Waitable": ("add_to_wait_set", "execute", "get_num_entities", "is_ready", "take_data"),
}
"""Methods that raise NotImplementedError in rclpy as well: tests/conformance shows it on both."""

MISSING = {
    "rclpy.destroyable": ["the module"],
    "rclpy.experimental": ["the module"],
    "rclpy.experimental.events_executor": ["the module"],
    "rclpy.task": ["FutureState (no such name)"],
}
"""Names for annotations only, and the EventsExecutor, which costs more than the executors here."""

TOOLS = {
    "ros2topic.api": ("get_msg_class", "get_topic_names", "get_topic_names_and_types"),
    "ros2node.api": (
        "get_absolute_node_name",
        "get_action_client_info",
        "get_action_server_info",
        "get_node_names",
        "get_publisher_info",
        "get_service_client_info",
        "get_service_server_info",
        "get_subscriber_info",
        "parse_node_name",
    ),
    "ros2service.api": ("get_service_class", "get_service_names", "get_service_names_and_types"),
    "ros2param.api": (
        "call_describe_parameters",
        "call_get_parameters",
        "call_list_parameters",
        "call_set_parameters",
        "get_parameter_type_string",
        "get_value",
        "load_parameter_file",
    ),
    "ros2action.api": ("get_action_clients_and_servers", "get_action_names", "get_action_names_and_types"),
    "ros2interface.api": ("interface_to_yaml", "package_name_completer", "type_completer"),
    "ros2pkg.api": ("get_executable_paths", "get_package_names", "get_prefix_path"),
    "rosidl_adapter.parser": ("parse_message_file", "parse_message_string", "parse_service_string"),
    "rosidl_parser.parser": ("parse_idl_file",),
    "tf2_ros.buffer_server": ("BufferServer",),
}
"""Functions and classes of ROS 2's tools that public programs import, by module."""

_ANY_POSITIONAL = Parameter("args", Parameter.VAR_POSITIONAL)
_ANY_KEYWORD = Parameter("kwargs", Parameter.VAR_KEYWORD)
_KINDS = {kind.name: kind for kind in type(Parameter.KEYWORD_ONLY)}


@cache
def api() -> dict[str, dict[str, Any]]:
    """The public API of the rclpy of ROS 2's wheels, by module."""
    command = [python("jazzy"), "-W", "ignore", str(Path(__file__).with_name("api.py"))]
    output = subprocess.check_output(command, env=environment("jazzy"), text=True)
    found: dict[str, dict[str, Any]] = json.loads(output)
    return found


@dataclass
class Module:
    """The public names of a module of rclpy, grouped by their support in this runtime."""

    name: str
    supported: list[str] = field(default_factory=list)
    not_implemented: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)


def modules() -> list[Module]:
    """Compare every module of ROS 2's rclpy with the module of this runtime."""
    return [_module(name, entries) for name, entries in api().items()]


def tools() -> list[Module]:
    rows = []
    for name, wanted in TOOLS.items():
        rows.append(row := Module(name))
        if importlib.util.find_spec(name.partition(".")[0]) is None or not importlib.util.find_spec(name):
            row.missing.append("the module")
            continue
        for entry in wanted:
            found = hasattr(importlib.import_module(name), entry)
            (row.supported if found else row.missing).append(entry)
    return rows


def surplus() -> list[str]:
    """Return the public members of classes that rclpy lacks: code that uses them would fail there."""
    recorded: dict[str, set[str]] = {}
    classes: list[type] = []
    for name, entries in api().items():
        if "the module" in MISSING.get(name, ()):
            continue
        for entry, facts in entries.items():
            # What a protocol or a class of C tells is incomplete.
            if "methods" in facts and not {"Protocol", "pybind11_object"} & {*facts["bases"]}:
                if (cls := getattr(importlib.import_module(name), entry, None)) is None:
                    continue
                recorded[cls.__name__] = {*facts["methods"]}
                classes.append(cls)
    found = set()
    for cls in classes:
        known = {name for base in cls.__mro__ for name in recorded.get(base.__name__, ())}
        found |= {f"{cls.__name__}.{name}" for name in _public_members(cls) - known}
    return sorted(found)


def _public_members(cls: type) -> set[str]:
    """The public methods and properties of a class, including those of its bases in rclpy."""
    return {
        name
        for base in cls.__mro__
        if base.__module__.startswith("rclpy") and not issubclass(base, Enum)
        for name, member in vars(base).items()
        if not name.startswith("_") or name in ("__enter__", "__exit__")
        if callable(member) or isinstance(member, property | classmethod | staticmethod)
    }


def table(rows: list[Module]) -> str:
    """Return a Markdown table: a row for each module that lacks something, and one for all others."""
    lines = ["| module | supported | raises NotImplementedError | missing |", "|---|---:|---|---|"]
    complete = [row for row in rows if not row.not_implemented and not row.missing]
    names = ", ".join(f"`{row.name}`" for row in complete)
    lines.append(f"| {names} | {sum(len(row.supported) for row in complete)} |  |  |")
    for row in (row for row in rows if row not in complete):
        not_implemented = ", ".join(f"`{name}`" for name in row.not_implemented)
        missing = ", ".join(f"`{name}`" for name in row.missing)
        lines.append(f"| `{row.name}` | {len(row.supported)} | {not_implemented} | {missing} |")
    total = sum(len(row.supported) for row in rows)
    unimplemented = sum(len(row.not_implemented) for row in rows)
    lines.append(f"| all | {total} | {unimplemented} | {sum(len(row.missing) for row in rows)} |")
    return "\n".join(lines)


def _module(name: str, entries: dict[str, Any]) -> Module:
    row = Module(name)
    try:
        module = importlib.import_module(name)
    except ImportError:
        row.missing.append("the module")
        return row
    for entry, recorded in entries.items():
        for path, problem in _problems(module, entry, recorded):
            if problem is None:
                row.supported.append(path)
            elif problem == "NotImplementedError":
                row.not_implemented.append(path)
            else:
                row.missing.append(path + problem)
    return row


def _problems(module: Any, name: str, facts: Any) -> Iterator[tuple[str, str | None]]:
    """Yield each name of an entry, and its problem, ``None`` if it is supported."""
    if not hasattr(module, name):
        yield name, " (no such name)"
    elif "parameters" in facts:
        yield name, _callable_problem(getattr(module, name), facts["parameters"])
    elif "methods" not in facts:
        yield name, None
    else:
        cls = getattr(module, name)
        absent = [member for member in facts.get("members", ()) if member not in cls.__members__]
        yield name, f" (without {', '.join(absent)})" if absent else None
        for method, parameters in facts["methods"].items():
            problem = _method_problem(cls, method, parameters)
            abstract = problem == "NotImplementedError" and method in ABSTRACT.get(name, ())
            yield f"{name}.{method}", None if abstract else problem


def _method_problem(cls: Any, name: str, parameters: Any) -> str | None:
    try:
        found = inspect.getattr_static(cls, name)
    except AttributeError:
        # Attributes of instances only: set in __init__, or fields of a dataclass.
        if parameters == "property" and name in _instance_attributes(cls):
            return None
        return " (no such name)"
    if parameters == "property":
        return None
    if isinstance(found, classmethod | staticmethod):
        found = found.__func__
    return _callable_problem(found, parameters)


def _instance_attributes(cls: Any) -> set[str]:
    source = "\n".join(textwrap.dedent(inspect.getsource(base)) for base in cls.__mro__[:-1])
    return {
        node.attr
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store)
    } | {name for base in cls.__mro__ for name in inspect.get_annotations(base)}


def _callable_problem(found: Any, parameters: list[tuple[str, str, bool]] | None) -> str | None:
    if _only_raises_not_implemented_error(found):
        return "NotImplementedError"
    if parameters is None:
        return None  # a function in C does not tell
    theirs = [
        Parameter(name, _KINDS[kind], default=None if has_default else Parameter.empty)
        for name, kind, has_default in parameters
    ]
    difference = _difference(list(inspect.signature(found).parameters.values()), theirs)
    return f" ({difference})" if difference else None


def _difference(ours: list[Parameter], theirs: list[Parameter]) -> str | None:
    """Return why a call that rclpy accepts would fail here, ``None`` if none would."""
    if theirs[-2:] == [_ANY_POSITIONAL, _ANY_KEYWORD]:
        return None  # rclpy delegates to a private method
    takes_any = {parameter.kind for parameter in ours} & {Parameter.VAR_KEYWORD, Parameter.VAR_POSITIONAL}
    if len(takes_any) == 2:
        return None
    by_name = {parameter.name: parameter for parameter in ours}
    positional = [p.name for p in ours if p.kind is not Parameter.KEYWORD_ONLY]
    for index, parameter in enumerate(theirs):
        if parameter.kind in (Parameter.VAR_KEYWORD, Parameter.VAR_POSITIONAL):
            if parameter.kind not in takes_any:
                return f"takes no *{parameter.name}"
            continue
        own = by_name.get(parameter.name)
        if own is None:
            if parameter.kind is Parameter.KEYWORD_ONLY and Parameter.VAR_KEYWORD in takes_any:
                continue
            return f"has no parameter {parameter.name}"
        if parameter.default is not Parameter.empty and own.default is Parameter.empty:
            return f"has no default for {parameter.name}"
        if parameter.kind is not Parameter.KEYWORD_ONLY and positional[index : index + 1] != [parameter.name]:
            return f"has {parameter.name} at another place"
    known = {parameter.name for parameter in theirs}
    for own in ours:
        variable = own.kind in (Parameter.VAR_KEYWORD, Parameter.VAR_POSITIONAL)
        if own.name not in known and own.default is Parameter.empty and not variable:
            return f"asks for {own.name}"
    return None


def _only_raises_not_implemented_error(function: Any) -> bool:
    try:
        body = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, TypeError):
        return False
    if not isinstance(body, ast.FunctionDef | ast.AsyncFunctionDef):
        return False
    last = body.body[-1]
    return (
        len(body.body) <= 2
        and isinstance(last, ast.Raise)
        and last.exc is not None
        and "NotImplementedError" in ast.unparse(last.exc)
    )


if __name__ == "__main__":
    print(table(modules()), table(tools()), sep="\n\n")
