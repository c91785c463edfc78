"""Simulations: many unmodified programs in one interpreter, in virtual time, on a simulated network."""

from __future__ import annotations

import importlib.util
import os
import random
import sys
import threading
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from contextlib import ExitStack
from types import CodeType, ModuleType, TracebackType
from typing import Any

import rclpy
from rclpy import context, signals, task, utilities
from rclpy._listeners import Listeners
from rclpy.impl import _logging_levels, _logging_output
from rclpy_simulation import patches
from rclpy_simulation.host import BOOT, SECOND, Host
from rclpy_simulation.kernel import Kernel, State
from rclpy_simulation.network import Delay, Network
from rclpy_simulation.participant import Domains
from rclpy_simulation.process import End, Process, Processes

Variable = State | tuple[MutableMapping[str, Any], str, Callable[[], Any]]
"""A mapping and a key, and what makes the first value; else each process begins with the present one."""

Program = str | Callable[[], Any]
"""The name of a module, run as by ``python -m``, or a function."""

_START = Delay(0.25, 0.5)  # s from the start of a process to the first line of its program
_MAIN = "__main__"


def _rclpy_state() -> list[tuple[State, Callable[[], Any]]]:
    vars(task._running).setdefault("awaited", None)
    return [
        ((vars(task._running), "awaited"), lambda: None),
        ((vars(rclpy), "_executor"), lambda: None),
        ((vars(utilities), "g_default_context"), lambda: None),
        ((vars(signals), "_executors"), Listeners),
        ((vars(signals), "_contexts"), Listeners),
        ((vars(signals), "_guards"), Listeners),
        ((vars(signals), "_previous"), dict),
        ((vars(signals), "_options"), lambda: signals.SignalHandlerOptions.NO),
        ((vars(signals), "_wakeup_fd"), lambda: -1),
        ((vars(context), "g_logging_ref_count"), lambda: 0),
        ((vars(context), "_joined"), set),
        ((vars(_logging_levels), "_default"), lambda: int(rclpy.logging.LoggingSeverity.INFO)),
        ((vars(_logging_levels), "_levels"), dict),
        ((vars(_logging_levels), "_effective"), dict),
        ((vars(_logging_output), "_console"), lambda: None),
        ((vars(_logging_output), "_console_enabled"), lambda: True),
        ((vars(_logging_output), "_rosout"), dict),
    ]


class Simulation:
    """Programs in virtual time, for as long as the ``with`` lasts.

    The same seed gives the same run, on every machine. A program is anything that spins a single-threaded
    executor. It must not wait outside of rclpy, ``time.sleep`` and ``threading.Event``: such a wait would
    stop all programs. ::

        with Simulation(seed=7) as simulation:
            talker = simulation.start("talker")
            simulation.run(60.0)
            talker.kill()
    """

    def __init__(
        self, seed: int | str = 0, network: Network | None = None, *, variables: Iterable[Variable] = ()
    ) -> None:
        """Prepare a simulation at time 0.

        :param network: how the network behaves.
        :param variables: module variables that each process has for itself, besides those of rclpy.
        """
        self.network = network or Network()
        self.seed = seed
        own = [*_rclpy_state(), *map(_own, variables)]
        names: list[State] = [(vars(sys), "argv"), (vars(sys), "stdout"), (vars(sys), "stderr")]
        names += [(vars(os), "environ"), (sys.modules, _MAIN), (vars(threading), "_main_thread")]
        self._first = [make for _, make in own]
        self._kernel = Kernel(seed, [*names, *(name for name, _ in own)])
        self._processes = Processes(self._kernel, context._leave_domains)
        self._domains = Domains(self._kernel, self.network)
        self._hosts: dict[str, Host] = {}
        self._code: dict[str, CodeType] = {}
        self._stack = ExitStack()

    def __enter__(self) -> Simulation:
        self._stack.enter_context(patches.installed(self._domains))
        state = random.getstate()
        self._stack.callback(random.setstate, state)
        random.seed(self.seed)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process in list(self._processes.alive.values()):
            process.abandon()
            process.kill()
        self._kernel.run_until(self._kernel.now)
        self._stack.close()

    # Time

    @property
    def now(self) -> float:
        """The time since the beginning [s]."""
        return (self._kernel.now - BOOT) / SECOND

    def run(self, seconds: float) -> None:
        self._kernel.run_until(self._kernel.now + int(seconds * SECOND))

    def run_until(self, condition: Callable[[], object], seconds: float = 60.0) -> None:
        """Let time pass until a condition is true. Raises TimeoutError if it is not within ``seconds``."""
        if not condition() and not self._kernel.run_until(
            self._kernel.now + int(seconds * SECOND), condition
        ):
            raise TimeoutError(f"the condition was not true within {seconds} simulated seconds")

    def at(self, time: float, action: Callable[[], Any]) -> None:
        """Run an action at a time since the beginning [s]."""
        self._kernel.schedule(BOOT + int(time * SECOND), lambda: self._kernel.run_outside(action))

    def after(self, seconds: float, action: Callable[[], Any]) -> None:
        self._kernel.after(int(seconds * SECOND), lambda: self._kernel.run_outside(action))

    @property
    def random(self) -> random.Random:
        """The source of all chance in this simulation."""
        return self._kernel.random

    # Processes and hosts

    def host(self, name: str) -> Host:
        """Return a host; it exists from its first use."""
        if name not in self._hosts:
            self._hosts[name] = Host(name)
        return self._hosts[name]

    def start(
        self,
        program: Program,
        *arguments: str,
        host: str = "localhost",
        environment: Mapping[str, str] | None = None,
        name: str = "",
        parent: int = 1,
        delay: Delay = _START,
    ) -> Process:
        """Start a program.

        :param arguments: of its command line.
        :param environment: its environment variables; by default, none.
        :param name: for the reader; by default that of the program.
        :param parent: the pid of the process that starts it.
        :param delay: from the start of the process to the first line of the program: Python starts.
        """
        title = name or (program if isinstance(program, str) else program.__name__)
        main = ModuleType(_MAIN)
        run = self._module(program, main) if isinstance(program, str) else program
        process = Process(self._processes, title, run, self.host(host), parent, dict(environment or {}))
        output = process.output
        process.saved = [[title, *arguments], output, output, _Environment(environment or {}), main]
        process.saved += [process.face, *(make() for make in self._first)]
        self._kernel.after(delay.draw(self._kernel), process.begin)
        return process

    def _module(self, name: str, main: ModuleType) -> Callable[[], None]:
        code = self._code.get(name)
        if code is None:
            spec = importlib.util.find_spec(name)
            loader: Any = spec and spec.loader
            if loader is None or (code := loader.get_code(name)) is None:
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)
            self._code[name] = code
        found = code
        return lambda: exec(found, vars(main))

    def set_drift(self, host: Host, rate: float) -> None:
        """Let the time of day of a host run faster: by ``rate`` [s/s], slower if negative."""
        host.drift(rate, self._kernel.now)

    def next_pid(self) -> int:
        """Return a pid for a process that is not a program of this simulation."""
        return self._kernel.next_pid()

    @property
    def processes(self) -> list[Process]:
        return list(self._processes.alive.values())

    @property
    def ends(self) -> list[End]:
        """The last processes that have ended, with their exit codes and output."""
        return list(self._processes.ends)

    # Network

    def cut(self, one: str, other: str) -> None:
        """Let no packet pass between two hosts, until :meth:`heal`."""
        self._domains.cut(one, other)

    def heal(self, one: str, other: str) -> None:
        """Let packets pass between two hosts again."""
        self._domains.heal(one, other)

    def hold(self, topic: str, seconds: float) -> None:
        """Let the samples arrive together at the end of a time that are sent in it: their path stalls.

        :param topic: as DDS names it, for example ``rt/chatter``.
        """
        until = self._kernel.now + int(seconds * SECOND)
        self.network.held[topic] = max(until, self.network.held.get(topic, 0))

    def listen(self, listener: Callable[[Process], Any]) -> None:
        """Call a function with a process each time before it runs: at each message, timer and other event."""
        self._processes.listeners.append(listener)

    def tap(self, listener: Callable[[Any, Any], None]) -> None:
        """Call a function with the writer and the sample of every message, before it is sent.

        It runs within the writing process. It may kill or stop any process, this one too: then the message
        is not sent, or only after SIGCONT.
        """
        self._domains.taps.append(listener)


class _Environment(dict[str, str]):
    def copy(self) -> dict[str, str]:
        return dict(self)


def _own(variable: Variable) -> tuple[State, Callable[[], Any]]:
    mapping, key, *make = variable
    present = mapping[key]
    return (mapping, key), make[0] if make else lambda: present
