"""What a simulated program sees of time, threads, signals and its process.

While a simulation runs, these functions replace those of the standard library. Code outside of
simulated programs gets the real ones through them.
"""

from __future__ import annotations

import atexit
import faulthandler
import os
import queue
import random
import signal
import socket
import sys
import threading
import time
import uuid
import weakref
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from rclpy_simulation import dates, inputs, locks, loops, refusals
from rclpy_simulation.ground import GROUND
from rclpy_simulation.host import SECOND
from rclpy_simulation.participant import Domains
from rclpy_simulation.process import Process, here, in_process, running
from rclpy_simulation.thread import ProcessExit, Thread


def _clock(read: Callable[[Process], Any], real: Callable[[], Any]) -> Callable[[], Any]:
    """As :func:`in_process`, without arguments: clocks are read often."""

    def call() -> Any:
        process = here.process
        return real() if process is None else read(process)

    return call


_INHERITED = object()
"""In place of what a class has of another one."""

# Time

_format, _local = time.strftime, time.localtime


def _sleep(process: Process, seconds: float) -> None:
    if seconds < 0:
        raise ValueError("sleep length must be non-negative")
    thread = running()
    deadline = process.present + int(seconds * SECOND)
    if deadline == process.kernel.now:
        thread.note_empty_wait()
        thread.wait(deadline)
    while process.kernel.now < deadline:
        thread.wait(deadline)


def _time_of_day(process: Process) -> int:
    return process.host.time_of_day(process.read_clock())


def _read_clock(process: Process, clock: int) -> int:
    return _time_of_day(process) if clock == time.CLOCK_REALTIME else process.read_clock()


def _of_day(convert: Callable[..., Any], present: Callable[[float], Any] = float) -> Callable[..., Any]:
    """Return a conversion of the time of day; without an argument, of the present one."""

    def call(process: Process, time: Any = None) -> Any:
        return convert(present(_time_of_day(process) / 1e9) if time is None else time)

    return in_process(call, convert)


def _strftime(process: Process, format: str, time: Any = None) -> str:
    return _format(format, _local(_time_of_day(process) / 1e9) if time is None else time)


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


def _seed(process: Process, generator: random.Random, seed: Any = None, version: int = 2) -> None:
    _really_seed(generator, process.kernel.random.getrandbits(64) if seed is None else seed, version)


_really_seed = random.Random.seed


def _random_bytes(process: Process, size: int) -> bytes:
    return process.kernel.random.randbytes(size)


def _seconds(real: Callable[[], float]) -> Callable[[], float]:
    """Return a clock of monotonic time [s]."""

    def call() -> float:
        process = here.process
        return real() if process is None else process.read_clock() / 1e9

    return call


def _replacements() -> list[tuple[Any, str, Any]]:
    def time_of_day(it: Process) -> float:
        return _time_of_day(it) / 1e9

    condition, thread = threading.Condition, threading.Thread
    return [
        (time, "monotonic_ns", _clock(Process.read_clock, time.monotonic_ns)),
        (time, "monotonic", _seconds(time.monotonic)),
        (time, "perf_counter_ns", _clock(Process.read_clock, time.perf_counter_ns)),
        (time, "perf_counter", _seconds(time.perf_counter)),
        (time, "time_ns", _clock(_time_of_day, time.time_ns)),
        (time, "time", _clock(time_of_day, time.time)),
        (time, "clock_gettime_ns", in_process(_read_clock, time.clock_gettime_ns)),
        (
            time,
            "clock_gettime",
            in_process(lambda it, clock: _read_clock(it, clock) / 1e9, time.clock_gettime),
        ),
        (time, "gmtime", _of_day(time.gmtime)),
        (time, "localtime", _of_day(time.localtime)),
        (time, "ctime", _of_day(time.ctime)),
        (time, "asctime", _of_day(time.asctime, time.localtime)),
        (time, "strftime", in_process(_strftime, time.strftime)),
        (time, "sleep", in_process(_sleep, time.sleep)),
        (condition, "wait", _method_in_process(_wait, condition.wait)),
        # In Python instead of C, so that it waits for a condition: thread pools work.
        (queue, "SimpleQueue", queue._PySimpleQueue),  # type: ignore[attr-defined]
        (thread, "start", _method_in_process(_start, thread.start)),
        (thread, "join", _of_thread(_join, thread.join)),
        (thread, "is_alive", _of_thread(lambda it: not it.done, thread.is_alive)),
        (threading, "get_ident", _get_ident(threading.get_ident)),
        (signal, "signal", in_process(_set_handler, signal.signal)),
        (signal, "getsignal", in_process(lambda it, number: it.handler(number), signal.getsignal)),
        # As if the program had a wake-up file descriptor of its own: the kernel wakes it without one.
        (signal, "set_wakeup_fd", in_process(lambda it, fd, **_: 0, signal.set_wakeup_fd)),
        (signal, "raise_signal", in_process(_raise_signal, signal.raise_signal)),
        (atexit, "register", in_process(_register, atexit.register)),
        (atexit, "unregister", in_process(_unregister, atexit.unregister)),
        (os, "getpid", _clock(lambda it: it.pid, os.getpid)),
        (os, "getppid", _clock(lambda it: it.parent_pid, os.getppid)),
        (os, "kill", in_process(_kill, os.kill)),
        (os, "_exit", in_process(_exit, os._exit)),
        (os, "urandom", in_process(_random_bytes, os.urandom)),
        (random.Random, "seed", _method_in_process(_seed, random.Random.seed)),
        (uuid, "_generate_time_safe", None),  # in C; without it, uuid1() asks the clock and getnode()
        (uuid, "getnode", _clock(lambda it: zlib.crc32(it.host.name.encode()), uuid.getnode)),
        # EventsExecutor turns it on, for the file of standard error: a simulated process has none.
        (faulthandler, "enable", in_process(lambda it, *_, **__: None, faulthandler.enable)),
        (socket, "gethostname", _clock(lambda it: it.host.name, socket.gethostname)),
        *(each for part in (dates, inputs, locks, loops, refusals) for each in part.replacements()),
    ]


def _method_in_process(simulated: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
    call = in_process(simulated, real)
    return lambda it, *arguments, **options: call(it, *arguments, **options)


def _names_of(functions: dict[int, Any]) -> list[tuple[Any, str, Any]]:
    """Return where modules have bound one of these functions by name, as ``from time import sleep`` does."""
    return [
        (module, name, functions[id(value)])
        for module_name, module in list(sys.modules.items())
        if module_name.partition(".")[0] != __package__  # it keeps the real ones
        for name, value in list(getattr(module, "__dict__", {}).items())
        if id(value) in functions
    ]


@contextmanager
def installed(domains: Domains) -> Iterator[None]:
    """Replace the functions until the end of the ``with``; new participants join ``domains``."""
    # The first finalizer of an interpreter registers an exit function, which ends all finalizers.
    # No simulated process may be the first: its end would end those of all others.
    weakref.finalize(domains, int).detach()
    new = _replacements()
    by_identity = {id(getattr(owner, name)): function for owner, name, function in new}
    replaced = [
        (owner, name, vars(owner).get(name, _INHERITED), function)
        for owner, name, function in [*new, *_names_of(by_identity)]
    ]
    for owner, name, _, function in replaced:
        setattr(owner, name, function)
    before, GROUND.domains = GROUND.domains, domains
    try:
        yield
    finally:
        GROUND.domains = before
        for owner, name, old, _ in reversed(replaced):
            if old is _INHERITED:
                delattr(owner, name)
            else:
                setattr(owner, name, old)
