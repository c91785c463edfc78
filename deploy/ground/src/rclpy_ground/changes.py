"""What is changed in rclpy, in memory, for a simulation. Nothing else of it is, and nothing on disk.

``Node.__hash__``, ``Clock.__hash__``
    Executors keep nodes in sets. By default an object's hash is its address, so the order of nodes and of
    their callbacks would differ from run to run. Here it is a number in the order of creation. Equality stays
    identity.

``Executor.__init__``, where one thread runs at a time
    Each callback triggers the executor's own guard condition, so that the executor looks at its entities
    again. It does so anyway before it waits: each second turn of its loop, half of its cost, would find
    nothing. So the guard condition is marked, and a trigger from before that look does not end the wait.
    Where other threads run meanwhile, it does: they may trigger it after the look.
"""

from __future__ import annotations

import functools
import itertools
from typing import Any

_numbers = itertools.count(1)


def _number(it: object) -> int:
    number: int = it.__dict__.setdefault("_ground_number", next(_numbers))
    return number


def make() -> None:
    from rclpy import clock, executors, node

    for kind in (node.Node, clock.Clock):
        setattr(kind, "__hash__", _number)  # noqa: B010 - the types of rclpy do not know
    _mark_guards(executors.Executor)


def _mark_guards(executor: Any) -> None:
    original = executor.__init__

    @functools.wraps(original)
    def init(self: Any, *arguments: Any, **options: Any) -> None:
        original(self, *arguments, **options)
        self._guard.handle.is_of_executor = True

    executor.__init__ = init
