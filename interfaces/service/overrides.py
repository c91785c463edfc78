"""Refuses words on the command line of a service that ROS ignores."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rclpy.node import Node
from rclpy.utilities import remove_ros_args

from interfaces.service.errors import UserError


def check(node: Node, arguments: Sequence[str]) -> None:
    """
    Check the command line against the parameters that a node has declared.

    A parameter file is not checked here: its ``/**`` may name parameters of other services.

    :param arguments: the command line, without the program.
    :raises UserError: for parameters that the node does not have, and for options outside of ``--ros-args``.
    """
    if options := [word for word in remove_ros_args(arguments) if word.startswith("-")]:
        raise UserError(f"{' '.join(options)}: no such option; those of ROS follow after --ros-args")
    if unknown := [name for name in _parameters(arguments) if not node.has_parameter(name)]:
        known = ", ".join(sorted(node.list_parameters([], 0).names))
        raise UserError(f"{', '.join(unknown)}: no such parameter; the parameters are {known}")


def _parameters(arguments: Sequence[str]) -> Iterator[str]:
    """Yield the names of the parameters that ``-p [node:]name:=value`` sets."""
    words = iter(arguments)
    is_ros = False
    for word in words:
        if word in ("--ros-args", "--"):
            is_ros = word == "--ros-args"
        elif is_ros and word in ("-p", "--param"):
            yield next(words).partition(":=")[0].rpartition(":")[2]
