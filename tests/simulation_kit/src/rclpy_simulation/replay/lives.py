"""The programs of a replay: they begin, end and are suspended at their times."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from rclpy_simulation.host import SECOND
from rclpy_simulation.process import Process
from rclpy_simulation.replay.player import AT_ONCE
from rclpy_simulation.simulation import Program, Simulation


class Suspension(NamedTuple):
    """Something in which a process lives, but does nothing. Times: ns since 1970."""

    begin: int
    end: int
    is_stop: bool = True
    """Whether it is stopped, as by SIGSTOP; else a callback takes so long."""


class Run(NamedTuple):
    """A program to be run, for one life of its process. Times: ns since 1970."""

    program: str
    """A module, run as by ``python -m``, or ``module:function``."""
    arguments: Sequence[str] = ()
    host: str = "localhost"
    begin: int | None = None
    """When its process begins; by default, with the simulation."""
    end: int | None = None
    """When its process is killed."""
    suspensions: Sequence[Suspension] = ()
    name: str = ""
    """For the reader; by default that of the program."""


def live(
    simulation: Simulation,
    run: Run,
    environment: Mapping[str, str],
    origin: int,
    started: Callable[[Process], Any],
) -> None:
    """Let a program live as its run says.

    :param origin: the time of day at time 0 of the simulation [ns since 1970].
    :param started: is called with the process when it begins.
    """

    def at(moment: int, action: Callable[[], Any]) -> None:
        simulation.at((max(moment - origin, 0) + 0.5) / SECOND, action)  # within the nanosecond

    def suspend(process: Process, each: Suspension) -> None:
        if each.is_stop:
            at(each.begin, process.stop)
            at(each.end, process.proceed)
        else:
            length = (each.end - each.begin) / SECOND
            at(each.begin, lambda: process.interrupt(lambda: time.sleep(length)))

    def begin() -> None:
        process = simulation.start(
            _program(run.program),
            *run.arguments,
            host=run.host,
            environment=environment,
            name=run.name or run.program,
            delay=AT_ONCE,
        )
        started(process)
        if run.end is not None:
            at(run.end, process.kill)
        for each in run.suspensions:
            suspend(process, each)

    if run.begin is None:
        begin()
    else:
        at(run.begin, begin)


def _program(name: str) -> Program:
    module, _, function = name.partition(":")
    if not function:
        return name

    def run() -> Any:
        return getattr(importlib.import_module(module), function)()

    return run
