"""Refuses words on the command line of a service that ROS ignores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

from rclpy.node import Node
from rclpy.parameter import PARAMETER_SEPARATOR_STRING
from rclpy.utilities import remove_ros_args

from interfaces.service import yaml_file
from interfaces.service.errors import UserError


def check(node: Node, arguments: Sequence[str]) -> None:
    """Check a command line, without the program, against the parameters that a node has declared.

    Of a parameter file, only the section of this node is checked: ``/**`` may name parameters of others.

    :raises UserError: for parameters that this node does not have, and for options outside of ``--ros-args``.
    """
    if options := [word for word in remove_ros_args(arguments) if word.startswith("-") or ":=" in word]:
        raise UserError(f"{' '.join(options)}: no such option; those of ROS follow after --ros-args")
    own = node.get_fully_qualified_name()
    given = [*_parameters(arguments), *_parameters_in_files(arguments, own)]
    if others := [f"{other}:{name}" for other, name in given if other and f"/{other}" != own]:
        raise UserError(f"{', '.join(others)}: this node is {own}; leave the name of the node out")
    if unknown := [name for _, name in given if not node.has_parameter(name)]:
        known = ", ".join(sorted(node.list_parameters([], 0).names))
        raise UserError(f"{', '.join(unknown)}: no such parameter; the parameters are {known}")


def _parameters(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the node, '' for any, and the name of each parameter that ``-p [node:]name:=value`` sets."""
    words = iter(arguments)
    is_ros = False
    for word in words:
        if word in ("--ros-args", "--"):
            is_ros = word == "--ros-args"
        elif is_ros and word in ("-p", "--param"):
            node, _, name = next(words).partition(":=")[0].rpartition(":")
            yield node, name


def _parameters_in_files(arguments: Sequence[str], own: str) -> Iterator[tuple[str, str]]:
    """Yield '' and the name of each parameter in the section of a node, of the files on a command line."""
    for option, path in pairwise(arguments):
        if option == "--params-file":
            document = yaml_file.load(path)
            for node in (own, own[1:]) if isinstance(document, dict) else ():
                yield from (("", name) for name in _names(document.get(node, {}).get("ros__parameters", {})))


def _names(parameters: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Yield the names of parameters, which may be nested."""
    for name, value in parameters.items():
        if isinstance(value, dict):
            yield from _names(value, f"{prefix}{name}{PARAMETER_SEPARATOR_STRING}")
        else:
            yield f"{prefix}{name}"
