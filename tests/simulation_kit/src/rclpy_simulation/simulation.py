"""Simulations: many unmodified programs in one interpreter, in virtual time, on a simulated network."""

from __future__ import annotations

import asyncio
import importlib.util
import os
import random
import sys
import threading
import uuid
from collections.abc import Callable, Iterable, Mapping, MutableMapping
from contextlib import ExitStack
from functools import partial
from importlib.machinery import ModuleSpec
from types import CodeType, ModuleType, TracebackType
from typing import Any

import rclpy
from rclpy import context, logging, utilities
from rclpy.impl.rcutils_logger import RcutilsLogger

from rclpy_ground import process as ground_process
from rclpy_simulation import patches
from rclpy_simulation.endpoints import Writer
from rclpy_simulation.faults import Fault, Faults
from rclpy_simulation.host import BOOT, MIDNIGHT, SECOND, Host
from rclpy_simulation.inputs import Input
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
_INSTALLATION = ("AMENT_PREFIX_PATH", "ROS_DISTRO")
"""Variables of a sourced ROS 2 by which programs find the files of packages."""


def _state() -> list[tuple[State, Callable[[], Any]]]:
    return [
        ((vars(rclpy), "__executor"), lambda: None),
        ((vars(utilities), "g_default_context"), lambda: None),
        ((vars(context), "g_logging_ref_count"), lambda: 0),
        ((vars(logging), "_root_logger"), RcutilsLogger),
        ((vars(ground_process), "current"), ground_process.ProcessState),
        ((vars(asyncio.events), "_event_loop_policy"), lambda: None),
        ((vars(uuid), "_last_timestamp"), lambda: None),
    ]


class Simulation:
    """Programs in virtual time, for as long as the ``with`` lasts.

    The same seed gives the same run, on every machine. Programs may wait as the README says; what is not
    simulated is refused. ::

        with Simulation(seed=7) as simulation:
            talker = simulation.start("talker")
            simulation.run(60.0)
            talker.kill()
    """

    def __init__(
        self,
        seed: int | str = 0,
        network: Network | None = None,
        *,
        epoch: int = MIDNIGHT,
        variables: Iterable[Variable] = (),
    ) -> None:
        """Prepare a simulation at time 0.

        :param network: how the network behaves.
        :param epoch: the time of day at time 0 [ns since 1970].
        :param variables: module variables that each process has for itself, besides those of rclpy.
        """
        self.network = network or Network()
        self.seed = seed
        self._epoch = epoch
        own = [*_state(), *map(_own, variables)]
        names: list[State] = [(vars(sys), name) for name in ("argv", "stdin", "stdout", "stderr")]
        names += [(vars(os), "environ"), (sys.modules, _MAIN), (vars(threading), "_main_thread")]
        self._first = [make for _, make in own]
        self._kernel = Kernel(seed, [*names, *(name for name, _ in own)])
        self._processes = Processes(self._kernel, lambda: ground_process.current.leave_domains())
        self.domains = Domains(self._kernel, self.network)
        self._hosts: dict[str, Host] = {}
        self._installation = {name: os.environ[name] for name in _INSTALLATION if name in os.environ}
        self._code: dict[str, tuple[CodeType, ModuleSpec]] = {}
        self._stack = ExitStack()
        self._faults = Faults(self)
        self.notes: list[Callable[[str, str], Any]] = []
        """Are called when a program starts, prints or ends, and with each fault; and with what is printed."""

    def __enter__(self) -> Simulation:
        self._stack.enter_context(patches.installed(self.domains))
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
        if error is None:
            self._faults.check()

    # Time

    @property
    def now(self) -> float:
        """The time since the beginning [s]."""
        return (self._kernel.now - BOOT) / SECOND

    def run(self, seconds: float) -> None:
        self._kernel.run_until(self._kernel.now + int(seconds * SECOND))

    def run_until(self, condition: Callable[[], object], seconds: float = 60.0) -> None:
        """Let time pass until a condition is true. Raises TimeoutError if it is not within ``seconds``."""
        __tracebackhide__ = True
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
            self._hosts[name] = Host(name, self._epoch)
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
        :param environment: its environment variables, besides those that name the installed ROS 2.
        :param name: for the reader; by default that of the program.
        :param parent: the pid of the process that starts it.
        :param delay: from the start of the process to the first line of the program: Python starts.
        """
        title = name or getattr(program, "__name__", str(program))
        self._faults.programs.add(title)
        main = ModuleType(_MAIN)
        run = self._module(program, main) if isinstance(program, str) else program
        variables = _Environment(self._installation | dict(environment or {}))
        process = Process(self._processes, title, run, self.host(host), parent, dict(variables))
        output, process.input = process.output, Input()
        process.saved = [
            [title, *arguments],
            process.input,
            output,
            output,
            variables,
            main,
        ]
        process.saved += [process.face, *(make() for make in self._first)]
        process.start_again = partial(
            self.start,
            program,
            *arguments,
            host=host,
            environment=environment,
            name=name,
            parent=parent,
            delay=delay,
        )
        if self.notes:
            self.note(f"{title} starts: pid {process.pid}")
            process.output.listener = partial(self.note, f"{title} prints")
            process.at_end(lambda: self.note(f"{title} has ended: exit code {process.exit_code}"))
        self._kernel.after(delay.draw(self._kernel), process.begin)
        return process

    def _module(self, name: str, main: ModuleType) -> Callable[[], None]:
        if name not in self._code:
            spec = importlib.util.find_spec(name)
            if spec is not None and spec.submodule_search_locations is not None:  # a package
                return self._module(f"{name}.__main__", main)
            loader: Any = spec and spec.loader
            if spec is None or loader is None or (code := loader.get_code(name)) is None:
                raise ModuleNotFoundError(f"No module named {name!r}", name=name)
            self._code[name] = code, spec
        code, spec = self._code[name]
        vars(main).update(
            __file__=spec.origin, __package__=spec.parent, __spec__=spec, __loader__=spec.loader
        )
        return lambda: exec(code, vars(main))

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

    # Faults

    def inflict(self, faults: Mapping[str, float] | Iterable[Fault]) -> None:
        """Let faults happen: these, or drawn ones.

        :param faults: the faults; or how many in a minute, by kind, or by kind and target:
            ``{"kill talker": 2, "stop": 1, "loss": 1, "delay": 1, "cut": 1}``.
        """
        if isinstance(faults, Mapping):
            self._faults.draw(faults)
        else:
            self._faults.inflict(faults)

    @property
    def faults(self) -> list[Fault]:
        """Those that have begun."""
        return list(self._faults.inflicted)

    def note(self, text: str, output: str = "") -> None:
        """Report to the :attr:`notes` what happens."""
        for note in self.notes:
            note(text, output)

    # Network

    def topics(self) -> list[str]:
        """Return the topics that programs publish, without those of all nodes."""
        writers = (
            endpoint.topic.removeprefix("rt")
            for participant in self.domains.participants
            for endpoint in participant.endpoints.values()
            if isinstance(endpoint, Writer) and endpoint.topic.startswith("rt/")
        )
        return sorted(set(writers) - {"/rosout", "/parameter_events"})

    def cut(self, one: str, other: str) -> None:
        """Let no packet pass between two hosts, until :meth:`heal`."""
        self.domains.cut(one, other)

    def heal(self, one: str, other: str) -> None:
        """Let packets pass between two hosts again."""
        self.domains.heal(one, other)

    def hold(self, topic: str, seconds: float) -> None:
        """Let the samples arrive together at the end of a time that are sent in it: their path stalls.

        :param topic: as DDS names it, for example ``rt/chatter``.
        """
        until = self._kernel.now + int(seconds * SECOND)
        self.network.held[topic] = max(until, self.network.held.get(topic, 0))

    def lose(self, topic: str, seconds: float) -> None:
        """Let the samples get lost that are sent in a time, reliable ones too: their readers are full.

        :param topic: as DDS names it, for example ``rt/chatter``.
        """
        until = self._kernel.now + int(seconds * SECOND)
        self.network.lost[topic] = max(until, self.network.lost.get(topic, 0))

    def listen(self, listener: Callable[[Process], Any]) -> None:
        """Call a function with a process each time before it runs: at each message, timer and other event."""
        self._processes.listeners.append(listener)

    def tap(self, listener: Callable[[Any, Any], None]) -> None:
        """Call a function with the writer and the sample of every message, before it is sent.

        It runs within the writing process. It may kill or stop any process, this one too: then the message
        is not sent, or only after SIGCONT.
        """
        self.domains.taps.append(listener)


class _Environment(dict[str, str]):
    def copy(self) -> dict[str, str]:
        return dict(self)


def _own(variable: Variable) -> tuple[State, Callable[[], Any]]:
    mapping, key, *make = variable
    present = mapping[key]
    return (mapping, key), make[0] if make else lambda: present
