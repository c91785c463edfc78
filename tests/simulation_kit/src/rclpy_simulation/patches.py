"""What a simulated program sees of time, threads, signals and its process.

While a simulation runs, these functions replace those of the standard library. Code outside of
simulated programs gets the real ones through them.
"""

from __future__ import annotations

import atexit
import os
import queue
import signal
import socket
import sys
import threading
import time
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from rclpy import _dds
from rclpy_simulation.conditions import GuardCondition, WaitSet
from rclpy_simulation.host import SECOND
from rclpy_simulation.participant import Domains, Participant
from rclpy_simulation.process import Process, here, running
from rclpy_simulation.thread import ProcessExit, Thread


def _in_process(simulated: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that does one thing in a simulated process, and the real one elsewhere."""

    def call(*arguments: Any, **options: Any) -> Any:
        process = here.process
        if process is None:
            return real(*arguments, **options)
        return simulated(process, *arguments, **options)

    return call


def _clock(read: Callable[[Process], Any], real: Callable[[], Any]) -> Callable[[], Any]:
    """As :func:`_in_process`, without arguments: clocks are read often."""

    def call() -> Any:
        process = here.process
        return real() if process is None else read(process)

    return call


# Time


def _sleep(process: Process, seconds: float) -> None:
    if seconds < 0:
        raise ValueError("sleep length must be non-negative")
    thread = running()
    deadline = process.kernel.now + int(seconds * SECOND)
    if deadline == process.kernel.now:
        thread.note_empty_wait()
        thread.wait(deadline)
    while process.kernel.now < deadline:
        thread.wait(deadline)


def _read_clock(process: Process, clock: int) -> int:
    now = process.kernel.now
    return process.host.time_of_day(now) if clock == time.CLOCK_REALTIME else now


def _of_day(convert: Callable[..., Any]) -> Callable[..., Any]:
    """Return a conversion of the time of day; without an argument, of the present one."""

    def call(process: Process, seconds: float | None = None) -> Any:
        return convert(_read_clock(process, time.CLOCK_REALTIME) / 1e9 if seconds is None else seconds)

    return _in_process(call, convert)


# Threads


class _Waiter:
    """Replaces the lock that a thread waits for in ``Condition.wait``."""

    def __init__(self) -> None:
        self.thread = running()
        self.is_released = False

    def release(self) -> None:
        self.is_released = True
        self.thread.wake()


def _wait(process: Process, condition: Any, timeout: float | None = None) -> bool:
    if not condition._is_owned():
        raise RuntimeError("cannot wait on un-acquired lock")
    waiter = _Waiter()
    condition._waiters.append(waiter)
    state = condition._release_save()
    try:
        waiter.thread.wait_until(lambda: waiter.is_released, timeout)
    finally:
        condition._acquire_restore(state)
        if not waiter.is_released:
            condition._waiters.remove(waiter)
    return waiter.is_released


def _start(process: Process, thread: threading.Thread) -> None:
    if thread._started.is_set():  # type: ignore[attr-defined]
        raise RuntimeError("threads can only be started once")
    process.start_thread(thread.run, thread)


def _of_thread(simulated: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of threads: the real one for a thread that was not started in a simulated process."""

    def call(thread: threading.Thread, *arguments: Any, **options: Any) -> Any:
        found = thread.__dict__.get("_simulated_thread")
        return simulated(found, *arguments, **options) if found else real(thread, *arguments, **options)

    return call


def _join(thread: Thread, timeout: float | None = None) -> None:
    thread.join(running(), timeout)


def _get_ident(real: Callable[[], int]) -> Callable[[], int]:
    def call() -> int:
        thread = here.thread
        return real() if thread is None else thread.ident

    return call


# Processes and signals


def _exit(process: Process, code: int) -> None:
    raise ProcessExit(code)


def _set_handler(process: Process, number: int, handler: Any) -> Any:
    if threading.current_thread() is not threading.main_thread():
        raise ValueError("signal only works in main thread of the main interpreter")
    previous = process.handler(number)
    process.handlers[number] = handler
    return previous


def _kill(process: Process, pid: int, number: int) -> None:
    target = process.processes.alive.get(pid)
    if target is None:
        raise ProcessLookupError(f"no simulated process {pid}")
    target.send_signal(number)
    process.settle()


def _raise_signal(process: Process, number: int) -> None:
    process.send_signal(number)
    process.settle()


def _register(process: Process, function: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    process.exit_functions.append(partial(function, *arguments, **options))
    return function


def _unregister(process: Process, function: Callable[..., Any]) -> None:
    process.exit_functions[:] = [
        each for each in process.exit_functions if getattr(each, "func", each) != function
    ]


def _random_bytes(process: Process, size: int) -> bytes:
    return process.kernel.random.randbytes(size)


def _replacements(domains: Domains) -> list[tuple[Any, str, Any]]:
    def monotonic(it: Process) -> float:
        return it.kernel.now / 1e9

    def time_of_day(it: Process) -> float:
        return it.host.time_of_day(it.kernel.now) / 1e9

    condition, thread = threading.Condition, threading.Thread
    return [
        (_dds, "Participant", partial(Participant, domains)),
        (_dds, "WaitSet", WaitSet),
        (_dds, "GuardCondition", GuardCondition),
        (time, "monotonic_ns", _clock(lambda it: it.kernel.now, time.monotonic_ns)),
        (time, "monotonic", _clock(monotonic, time.monotonic)),
        (time, "perf_counter_ns", _clock(lambda it: it.kernel.now, time.perf_counter_ns)),
        (time, "perf_counter", _clock(monotonic, time.perf_counter)),
        (time, "time_ns", _clock(lambda it: it.host.time_of_day(it.kernel.now), time.time_ns)),
        (time, "time", _clock(time_of_day, time.time)),
        (time, "clock_gettime_ns", _in_process(_read_clock, time.clock_gettime_ns)),
        (
            time,
            "clock_gettime",
            _in_process(lambda it, clock: _read_clock(it, clock) / 1e9, time.clock_gettime),
        ),
        (time, "gmtime", _of_day(time.gmtime)),
        (time, "localtime", _of_day(time.localtime)),
        (time, "ctime", _of_day(time.ctime)),
        (time, "sleep", _in_process(_sleep, time.sleep)),
        (condition, "wait", _method_in_process(_wait, condition.wait)),
        # In Python instead of C, so that it waits for a condition: thread pools work.
        (queue, "SimpleQueue", queue._PySimpleQueue),  # type: ignore[attr-defined]
        (thread, "start", _method_in_process(_start, thread.start)),
        (thread, "join", _of_thread(_join, thread.join)),
        (thread, "is_alive", _of_thread(lambda it: not it.done, thread.is_alive)),
        (threading, "get_ident", _get_ident(threading.get_ident)),
        (signal, "signal", _in_process(_set_handler, signal.signal)),
        (signal, "getsignal", _in_process(lambda it, number: it.handler(number), signal.getsignal)),
        # As if the program had a wake-up file descriptor of its own: the kernel wakes it without one.
        (signal, "set_wakeup_fd", _in_process(lambda it, fd, **_: 0, signal.set_wakeup_fd)),
        (signal, "raise_signal", _in_process(_raise_signal, signal.raise_signal)),
        (atexit, "register", _in_process(_register, atexit.register)),
        (atexit, "unregister", _in_process(_unregister, atexit.unregister)),
        (os, "getpid", _clock(lambda it: it.pid, os.getpid)),
        (os, "getppid", _clock(lambda it: it.parent_pid, os.getppid)),
        (os, "kill", _in_process(_kill, os.kill)),
        (os, "_exit", _in_process(_exit, os._exit)),
        (os, "urandom", _in_process(_random_bytes, os.urandom)),
        (socket, "gethostname", _clock(lambda it: it.host.name, socket.gethostname)),
    ]


def _method_in_process(simulated: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
    call = _in_process(simulated, real)
    return lambda it, *arguments, **options: call(it, *arguments, **options)


def _names_of(functions: dict[int, Any]) -> list[tuple[Any, str, Any]]:
    """Return where modules have bound one of these functions by name, as ``from time import sleep`` does."""
    patches = sys.modules[__name__]
    return [
        (module, name, functions[id(value)])
        for module in list(sys.modules.values())
        if module is not patches
        for name, value in list(getattr(module, "__dict__", {}).items())
        if id(value) in functions
    ]


@contextmanager
def installed(domains: Domains) -> Iterator[None]:
    """Replace the functions until the end of the ``with``; new participants join ``domains``."""
    # The first finalizer of an interpreter registers an exit function, which ends all finalizers.
    # No simulated process may be the first: its end would end those of all others.
    weakref.finalize(domains, int).detach()
    new = _replacements(domains)
    by_identity = {id(vars(owner)[name]): function for owner, name, function in new}
    replaced = [
        (owner, name, vars(owner)[name], function)
        for owner, name, function in [*new, *_names_of(by_identity)]
    ]
    for owner, name, _, function in replaced:
        setattr(owner, name, function)
    try:
        yield
    finally:
        for owner, name, old, _ in reversed(replaced):
            setattr(owner, name, old)
