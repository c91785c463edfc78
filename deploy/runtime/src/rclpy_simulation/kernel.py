"""The kernel of a simulation: virtual time, its events, and the process whose code runs now."""

from __future__ import annotations

import heapq
import itertools
import random
import threading
from collections import deque
from collections.abc import Callable, MutableMapping
from typing import TYPE_CHECKING, Any, NamedTuple

from greenlet import getcurrent

from rclpy_simulation.host import BOOT

if TYPE_CHECKING:
    from rclpy_simulation.network import Domains
    from rclpy_simulation.process import Process
    from rclpy_simulation.thread import Thread

_LAST_ENDS = 8

State = tuple[MutableMapping[str, Any], str]
"""A mapping and a key: a variable that each process has for itself, such as ``(sys.__dict__, "argv")``."""


class _Here(threading.local):
    """What runs now in the real thread of the simulation; other real threads run nothing simulated."""

    process: Process | None = None
    """The process whose code runs; ``None`` for the code of the simulation itself."""
    thread: Thread | None = None


here = _Here()


class End(NamedTuple):
    """What is left of a process that has ended."""

    name: str
    pid: int
    exit_code: int
    output: str


class Kernel:
    """Runs events in the order of virtual time, and switches between threads."""

    def __init__(self, seed: int | str, state: list[State]) -> None:
        """
        Begin at :data:`BOOT`.

        :param state: the variables that each process has for itself.
        """
        self.now = BOOT
        """Monotonic time [ns]."""
        self.random = random.Random(seed)
        self.hub = getcurrent()
        self.domains: Domains
        self.listeners: list[Callable[[Process], Any]] = []
        """Are called with a process before it runs: because of a message, a timer, or another event."""
        self.at_exit: Callable[[], Any] = lambda: None
        """Runs in a process that ends in order."""
        self.processes: dict[int, Process] = {}
        """Those that live, by pid."""
        self.ends: deque[End] = deque(maxlen=_LAST_ENDS)
        """The last processes that have ended."""
        self.unwilling: list[Thread] = []
        """Threads of killed processes that catch every exception: they wait forever."""
        self._events: list[tuple[int, int, Callable[[], Any]]] = []
        self._orders = itertools.count()
        self._pids = itertools.count(1000)
        self._numbers = itertools.count(1)
        self._state = state
        self._loaded: Process | None = None  # its variables are in place
        self._own: list[Any] = []  # the variables of the code that runs the simulation

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
        """
        Let time pass until ``end`` [ns], or until a condition is true after an event.

        :return: whether the condition is true; without one, ``False``.
        """
        if here.process is not None:
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

    def note_end(self, process: Process, code: int) -> None:
        """Note that a process has ended."""
        self.ends.append(End(process.name, process.pid, code, process.output.text))

    def switch(self, process: Process, thread: Thread, enter: Callable[[], Any]) -> None:
        """Run a thread until it waits or ends."""
        if self._loaded is not process:
            self.load(process)
        here.process, here.thread = process, thread
        try:
            enter()
        finally:
            here.process = here.thread = None

    def load(self, process: Process | None) -> None:
        """Put the variables of a process in place of those of the last one."""
        before = self._loaded
        if before is process:
            return
        state = self._state
        values = [mapping[key] for mapping, key in state]
        if before is None:
            self._own = values
        else:
            before.saved = values
        self._loaded = process
        wanted = self._own if process is None else process.saved
        for (mapping, key), value in zip(state, wanted, strict=True):
            mapping[key] = value


def running() -> Thread:
    """Return the thread that runs now. Raises RuntimeError outside of simulated programs."""
    if here.thread is None:
        raise RuntimeError("only simulated programs can do this: start them with Simulation.start")
    return here.thread
