"""The kernel of a simulation: virtual time, its events, and the variables that each process has."""

from __future__ import annotations

import heapq
import itertools
import operator
import random
from collections.abc import Callable, MutableMapping
from typing import Any

from greenlet import getcurrent

from rclpy_simulation.host import BOOT

State = tuple[MutableMapping[str, Any], str]
"""A mapping and a key: a variable that each process has for itself, such as ``(sys.__dict__, "argv")``."""


class Kernel:
    """Runs events in the order of virtual time, and switches between programs."""

    def __init__(self, seed: int | str, state: list[State]) -> None:
        """Begin at :data:`BOOT`; ``state`` has the variables that each process has for itself."""
        self.now = BOOT
        """Monotonic time [ns]."""
        self.random = random.Random(seed)
        self.hub = getcurrent()
        self._events: list[tuple[int, int, Callable[[], Any]]] = []
        self._orders = itertools.count()
        self._pids = itertools.count(1000)
        self._numbers = itertools.count(1)
        self._mappings = [mapping for mapping, _ in state]
        self._keys = [key for _, key in state]
        self._own: list[Any] = []  # the variables of the code that runs the simulation
        self._loaded = self._own  # those that are in place
        self._runs_program = False

    def next_pid(self) -> int:
        """Return a pid that no process had before."""
        return next(self._pids)

    def next_number(self) -> int:
        """Return a number that no entity had before."""
        return next(self._numbers)

    def schedule(self, time: int, action: Callable[[], Any]) -> None:
        """Run an action of the simulation at a time [ns]; actions of one time keep their order."""
        heapq.heappush(self._events, (time, next(self._orders), action))

    def after(self, delay: int, action: Callable[[], Any]) -> None:
        """Run an action of the simulation after a delay [ns]."""
        self.schedule(self.now + delay, action)

    def run_until(self, end: int, condition: Callable[[], object] | None = None) -> bool:
        """Let time pass until ``end`` [ns], or until a condition is true after an event.

        :return: whether the condition is true; without one, ``False``.
        """
        if self._runs_program:
            raise RuntimeError("a simulated program cannot run the simulation")
        self.hub = getcurrent()
        events, pop = self._events, heapq.heappop
        try:
            while events and events[0][0] <= end:
                time, _, action = pop(events)
                if time > self.now:
                    self.now = time
                action()
                if condition is not None:
                    self.load(None)
                    if condition():
                        return True
            self.now = max(self.now, end)
            return False
        finally:
            self.load(None)

    def run_outside(self, action: Callable[[], Any]) -> None:
        """Run an action of the code that runs the simulation, with its own variables."""
        self.load(None)
        action()

    def switch(self, variables: list[Any], enter: Callable[[], Any]) -> None:
        """Run a program with its variables until it waits or ends."""
        self.load(variables)
        self._runs_program = True
        try:
            enter()
        finally:
            self._runs_program = False

    def load(self, variables: list[Any] | None) -> None:
        """Put variables in place of the last ones; ``None``: those of the code that runs the simulation."""
        wanted = self._own if variables is None else variables
        before = self._loaded
        if before is wanted:
            return
        before[:] = map(operator.getitem, self._mappings, self._keys)
        self._loaded = wanted
        for _ in map(operator.setitem, self._mappings, self._keys, wanted):
            pass
