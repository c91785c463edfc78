"""Threads of simulated processes: they take turns, and virtual time passes only while all of them wait."""

from __future__ import annotations

import threading
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures.thread import _threads_queues
from pathlib import Path
from typing import Any, Protocol

from greenlet import GreenletExit, greenlet

import rclpy_ground
from rclpy_simulation import running_loop
from rclpy_simulation.host import SECOND
from rclpy_simulation.kernel import Kernel
from rclpy_simulation.missing import note_origin

BUSY_WAITS = 1000  # without waiting in between: then a thread is taken for a busy loop
_BUSY_PAUSE = SECOND // 1000
_FIRST_IDENT = 1 << 62  # real identifiers of threads are addresses below
_OURS = tuple(str(Path(str(module.__file__)).parent) for module in (rclpy_ground, running_loop))
_FAULTS = (AssertionError, AttributeError, LookupError, NameError)
"""Errors of which the kit raises none on purpose."""


class ProcessExit(BaseException):
    """``os._exit`` in a simulated process."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class Owner(Protocol):
    """The process of a thread, as the thread sees it."""

    kernel: Kernel
    exit_code: int | None
    interrupts: deque[Callable[[], Any]]
    listeners: Sequence[Callable[..., Any]]
    is_stopped: bool
    is_hung: bool

    @property
    def present(self) -> int: ...

    def postpone(self, action: Callable[[], Any]) -> None: ...

    def is_about_to_run(self) -> bool: ...

    def switch(self, thread: Thread, enter: Callable[[], Any]) -> None: ...

    def refuse(self, thread: Thread) -> None: ...

    def handle_interrupts(self, thread: Thread) -> None: ...

    def end_with(self, error: BaseException, name: str) -> None: ...


class Thread:
    """A thread of a simulated process.

    It is a greenlet, which runs until it waits: in a DDS wait set, in ``time.sleep``, for a lock, for a
    condition, for standard input, or in an event loop of asyncio.
    """

    def __init__(self, process: Owner, work: Callable[[], Any], face: threading.Thread) -> None:
        """Prepare a thread; ``face`` is what ``threading.current_thread`` returns in it."""
        self.process = process
        self.face = face
        self.ident = _FIRST_IDENT + process.kernel.next_number()
        self.done = False
        self._waiters: list[Thread] = []  # threads that join this one
        self._work = work
        self._greenlet = greenlet(self._run, parent=process.kernel.hub)
        self._waits = True
        self._is_due = False  # a resumption is scheduled, or postponed until the process runs again
        self._deadline: int | None = None
        self._alarm: int | None = None  # the time of the scheduled check of the deadline
        self._busy_at = -1
        self._busy_waits = 0
        face._ident = self.ident  # type: ignore[attr-defined]
        face._started.set()  # type: ignore[attr-defined]
        face.__dict__["_simulated_thread"] = self
        # threading.current_thread() looks here.
        threading._active[self.ident] = face  # type: ignore[attr-defined]

    def _run(self) -> None:
        try:
            self._work()
        except (GreenletExit, SystemExit):
            pass
        except BaseException as error:
            self.process.end_with(error, self.face.name)
        finally:
            self._end()

    def _end(self) -> None:
        self.done = True
        threading._active.pop(self.ident, None)  # type: ignore[attr-defined]
        _threads_queues.pop(self.face, None)  # type: ignore[attr-defined]  # else Python joins it at its exit
        for waiter in self._waiters:
            waiter.wake()

    def wake(self) -> None:
        if self._waits and not self._is_due and not self.done:
            self._is_due = True
            kernel = self.process.kernel
            kernel.schedule(kernel.now, self._resume)

    def _resume(self) -> None:
        process = self.process
        if process.is_stopped or process.is_hung:
            process.postpone(self._resume)
            return
        self._is_due = False
        if self._waits and not self.done and process.exit_code is None:
            if process.listeners and not process.is_about_to_run():
                self.wake()
                return
            self._waits = False
            process.switch(self, self._greenlet.switch)

    def wait(self, deadline: int | None) -> None:
        """Let other threads run until this one is woken, or until a time of the monotonic clock [ns]."""
        process = self.process
        kernel = process.kernel
        if process.exit_code is not None:
            process.refuse(self)
        self._waits, self._deadline = True, deadline
        if deadline is not None and (self._alarm is None or deadline < self._alarm):
            self._alarm = max(deadline, kernel.now)
            kernel.schedule(self._alarm, self._ring)
        if running_loop.present() is None:
            kernel.hub.switch()
        else:
            left = running_loop.leave()
            try:
                kernel.hub.switch()
            finally:
                running_loop.enter(left)
        if process.interrupts or process.exit_code is not None:
            process.handle_interrupts(self)

    def _ring(self) -> None:
        kernel = self.process.kernel
        if self._alarm != kernel.now:
            return  # an earlier alarm was set later
        self._alarm = None
        if self._waits and self._deadline is not None:
            if self._deadline <= kernel.now:
                self.wake()
            else:
                self._alarm = self._deadline
                kernel.schedule(self._alarm, self._ring)

    def note_empty_wait(self) -> None:
        """Note a wait of zero length; a busy loop of them lets time pass."""
        now = self.process.kernel.now
        self._busy_waits = self._busy_waits + 1 if self._busy_at == now else 0
        self._busy_at = now
        if self._busy_waits > BUSY_WAITS:
            self.pause()

    def pause(self) -> None:
        """Let a moment pass, as the code that has just run would have taken in reality."""
        self.wait(self.process.kernel.now + _BUSY_PAUSE)

    def wait_until(self, condition: Callable[[], object], timeout: float | None) -> None:
        """Wait until a condition is true, at most ``timeout`` [s]; who makes it true wakes this thread."""
        kernel = self.process.kernel
        deadline = None if timeout is None else self.process.present + int(timeout * SECOND)
        if deadline is not None and deadline <= kernel.now:
            self.note_empty_wait()
        while not condition() and (deadline is None or kernel.now < deadline):
            self.wait(deadline)

    def join(self, waiting: Thread, timeout: float | None) -> None:
        """Let the running thread wait for the end of this one, at most ``timeout`` [s]."""
        if waiting is self:
            raise RuntimeError("cannot join current thread")
        self._waiters.append(waiting)
        try:
            waiting.wait_until(lambda: self.done, timeout)
        finally:
            self._waiters.remove(waiting)

    def throw(self) -> None:
        """Unwind this thread of a killed process."""
        if not self.done:
            if self._greenlet:
                self._waits = False
                self.process.switch(self, self._greenlet.throw)
            self._end()


def trace(error: BaseException) -> str:
    """Return the traceback of a program's error as on rcl: there, what is below and around it has no frames.

    Frames of the kit remain where it seems to be the one that fails.
    """
    note_origin(error)
    shown = traceback.TracebackException.from_exception(error)
    _hide(shown, keeps_last=isinstance(error, _FAULTS))
    return "".join(shown.format())


def _hide(shown: traceback.TracebackException, keeps_last: bool = False) -> None:
    """Leave out the frames of the kit, of causes and members too."""
    frames = [frame for frame in shown.stack if not frame.filename.startswith(_OURS)]
    if frames and not (keeps_last and shown.stack[-1] is not frames[-1]):
        shown.stack[:] = frames
    for other in (shown.__cause__, shown.__context__, *(getattr(shown, "exceptions", None) or ())):
        if other is not None:
            _hide(other)
