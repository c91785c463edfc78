"""The node of a tool that is written for ROS 2's `ros2cli`."""

from __future__ import annotations

import argparse
from types import TracebackType
from typing import TYPE_CHECKING, Any

from ros2cli import graph

if TYPE_CHECKING:
    from rclpy.node import Node


class NodeStrategy:
    """A context manager that gives a node; there is no daemon. ``args``: see :func:`add_arguments`."""

    def __init__(self, args: Any) -> None:
        spin_time = getattr(args, "spin_time", None)
        spin_time = graph.default_spin_time() if spin_time is None else spin_time
        use_sim_time = getattr(args, "use_sim_time", False)
        self._scope = graph.node(spin_time, use_sim_time=use_sim_time)
        self._node: Node | None = None

    def __enter__(self) -> NodeStrategy:
        self._node = self._scope.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._scope.__exit__(kind, error, traceback)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._node, name)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that :class:`NodeStrategy` reads."""
    parser.add_argument("--spin-time", type=float, help="how long to look for other nodes [s]")
    parser.add_argument("-s", "--use-sim-time", action="store_true", help="use simulated time")
    parser.add_argument("--no-daemon", action="store_true", help="no effect: there is no daemon")
