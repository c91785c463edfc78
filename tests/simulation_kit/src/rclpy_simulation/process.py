"""Simulated processes: their life, their signals, and what can happen to them."""

from __future__ import annotations

import signal
import threading
from _thread import _local
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures.thread import _threads_queues
from typing import Any, NamedTuple, Protocol

from greenlet import GreenletExit

from rclpy_simulation.host import Host
from rclpy_simulation.kernel import Kernel
from rclpy_simulation.output import Output
from rclpy_simulation.thread import ProcessExit, Thread, trace

READING = 1000
"""How long a process takes to read a clock [ns]; other code takes no time."""
_AHEAD = 1000 * READING  # by which its clock may be ahead of the others [ns]
_LAST_ENDS = 8
_UNWILLING = 100  # waits of a killed thread that catches every exception
_IGNORED = (signal.SIGCHLD, signal.SIGURG, signal.SIGWINCH, signal.SIGPIPE)  # by default, in Python


class Member(Protocol):
    """A DDS participant, as its process sees it."""

    def vanish(self) -> None: ...

    def fall_silent(self) -> None: ...

    def speak_again(self) -> None: ...


class End(NamedTuple):
    """What is left of a process that has ended."""

    name: str
    pid: int
    exit_code: int
    output: str


class Processes:
    """The processes of a simulation."""

    def __init__(self, kernel: Kernel, at_exit: Callable[[], Any]) -> None:
        """Begin without a process; ``at_exit`` runs in a process that ends in order."""
        self.kernel = kernel
        self.at_exit = at_exit
        self.listeners: list[Callable[[Process], Any]] = []
        """Are called with a process before it runs: because of a message, a timer, or another event."""
        self.alive: dict[int, Process] = {}
        """Those that live, by pid."""
        self.ends: deque[End] = deque(maxlen=_LAST_ENDS)
        """The last processes that have ended."""
        self.unwilling: list[Thread] = []
        """Threads of killed processes that catch every exception: they wait forever."""


class Process:
    """A simulated process: the life of one program, from its start to its end."""

    def __init__(
        self,
        processes: Processes,
        name: str,
        main: Callable[[], Any],
        host: Host,
        parent: int,
        environment: Mapping[str, str],
    ) -> None:
        self.processes = processes
        self.kernel = kernel = processes.kernel
        self.listeners = processes.listeners
        self.name = name
        self.host = host
        self.pid = kernel.next_pid()
        self.parent_pid = parent
        self.environment = environment
        """The variables that it was started with."""
        self.began = kernel.now
        self.input: Any = None
        """Standard input: ``input.type("text\\n")`` types at the terminal of the program."""
        self.output = Output()
        self.exit_code: int | None = None
        """``None`` while it is alive, the negative signal number if a signal has killed it."""
        self.start_again: Callable[[], Any] = lambda: None
        """Starts its program once more, as another process."""
        self.participants: list[Member] = []
        self.handlers: dict[int, Any] = {}
        """The signal handlers by signal."""
        self.exit_functions: list[Callable[[], Any]] = []
        self.interrupts: deque[Callable[[], Any]] = deque()
        """Actions that wait for the main thread."""
        self.face = threading.Thread(name="MainThread", daemon=False)
        """The main thread, as its program sees it."""
        self.saved: list[Any] = []
        """The module variables of the process while another one runs."""
        self.is_stopped = False
        """Whether SIGSTOP has suspended it."""
        self.is_hung = False
        """Whether it runs an endless loop."""
        self.steps_left = 0
        """After so many steps of :meth:`stop_after` it stops; 0 for never."""
        self._read_at = 0  # the last reading of its clock [ns]
        self._main = main
        self._at_end: list[Callable[[], Any]] = []
        self._threads: list[Thread] = []
        self._postponed: list[Callable[[], Any]] = []
        self._refused = 0
        processes.alive[self.pid] = self

    def __repr__(self) -> str:
        return f"<{self.name} {self.pid}>"

    @property
    def ended(self) -> bool:
        return self.exit_code is not None

    @property
    def is_suspended(self) -> bool:
        """Whether it runs nothing at present: stopped, or in an endless loop."""
        return self.is_stopped or self.is_hung

    # Its clock

    @property
    def present(self) -> int:
        """The monotonic time, as its program knows it [ns]."""
        return max(self.kernel.now, self._read_at)

    def read_clock(self) -> int:
        """Return the monotonic time [ns]. A reading takes a microsecond, so that no loop of them is endless.

        The process may stop just before.
        """
        if self.steps_left:
            self.step()
        now = self.kernel.now
        if self._read_at < now:
            self._read_at = now
        else:
            self._read_at += READING
            if self._read_at - now >= _AHEAD:
                running().wait(self._read_at)
        return self._read_at

    # Its life

    def begin(self) -> None:
        if not self.ended:
            self.start_thread(self._run, self.face)

    def start_thread(self, work: Callable[[], Any], face: threading.Thread) -> None:
        """Start a thread; the first one is the main thread."""
        if len(self._threads) > 1:
            self._threads[1:] = [thread for thread in self._threads[1:] if not thread.done]
        thread = Thread(self, work, face)
        self._threads.append(thread)
        thread.wake()

    def is_about_to_run(self) -> bool:
        """Inform the listeners that it is about to run; return whether it may: they can kill or stop it."""
        for listener in self.listeners:
            listener(self)
        return self.exit_code is None and not self.is_suspended

    def switch(self, thread: Thread, enter: Callable[[], Any]) -> None:
        """Run a thread until it waits or ends."""
        here.process, here.thread = self, thread
        try:
            self.kernel.switch(self.saved, enter)
        finally:
            here.process = here.thread = None

    def _run(self) -> None:
        code = self._code_of(self._main)
        for thread in self._threads[1:]:
            if not thread.face.daemon and thread.face not in _threads_queues:  # Python ends pools itself
                code = self._code_of(lambda it=thread: it.join(running(), None)) or code  # type: ignore[misc]
        while self.exit_functions:
            self._code_of(self.exit_functions.pop())
        self._code_of(self.processes.at_exit)
        self.exit(code)

    def _code_of(self, work: Callable[[], Any]) -> int:
        """Run a part of the program; return the exit code with which it ends."""
        try:
            work()
        except SystemExit as error:
            if error.code is None or isinstance(error.code, int):
                return error.code or 0
            self.output.write(f"{error.code}\n")
            return 1
        except (GreenletExit, ProcessExit):
            raise
        except BaseException as error:
            self.output.write(trace(error))
            return -signal.SIGINT if isinstance(error, KeyboardInterrupt) else 1
        return 0

    def refuse(self, thread: Thread) -> None:
        """Raise in a killed process: it must not run on."""
        self._refused += 1
        if self._refused > _UNWILLING:  # it catches every exception: leave it where it is
            self.processes.unwilling.append(thread)
            self.kernel.hub.switch()
        raise GreenletExit

    def exit(self, code: int) -> None:
        """End at once."""
        if self.ended:
            return
        self.exit_code = code
        self.output.end()
        self.processes.ends.append(End(self.name, self.pid, code, self.output.text))
        for participant in list(self.participants):
            participant.vanish()
        del self.processes.alive[self.pid]
        self.kernel.schedule(self.kernel.now, self._clear)

    def end_with(self, error: BaseException, name: str) -> None:
        """Note what has ended the thread of a name: ``os._exit``, or an error of the program."""
        if isinstance(error, ProcessExit):
            self.exit(error.code)
        else:
            self.output.write(f"Exception in thread {name}:\n{trace(error)}")

    def _clear(self) -> None:
        for thread in self._threads:
            thread.throw()
        self.kernel.load(None)
        self._threads, self._postponed, self.participants, self.saved = [], [], [], []
        self.interrupts.clear()
        self.handlers.clear()
        self.exit_functions.clear()
        for action in self._at_end:
            action()

    def at_end(self, action: Callable[[], Any]) -> None:
        """Run an action of the simulation when the process has ended."""
        self._at_end.append(action)

    def abandon(self) -> None:
        self._at_end.clear()

    # What happens to it

    def kill(self) -> None:
        """SIGKILL: it ends at once, without a word to anyone."""
        self.exit(-signal.SIGKILL)

    def stop(self) -> None:
        """SIGSTOP: it runs nothing until :meth:`proceed`."""
        if not self.is_stopped and not self.ended:
            self.is_stopped = True
            for participant in self.participants:
                participant.fall_silent()

    def stop_after(self, steps: int) -> None:
        """SIGSTOP inside a callback: just before it reads a clock, publishes or takes for the n-th time.

        :param steps: counts them from now on; 0 takes it back.
        """
        self.steps_left = steps

    def step(self) -> None:
        """Note that it is about to read a clock, to publish or to take."""
        if here.process is self:  # not the simulation itself
            self.steps_left -= 1
            if not self.steps_left:
                self.stop()
                self.settle()

    def hang(self) -> None:
        """Let it run an endless loop in a callback. DDS, which has threads of its own, continues."""
        self.is_hung = True

    def proceed(self) -> None:
        """SIGCONT: it resumes, with all that has arrived meanwhile."""
        if not self.is_stopped or self.ended:
            return
        self.is_stopped = False
        postponed, self._postponed = self._postponed, []
        for action in postponed:
            action()
        for participant in self.participants:
            participant.speak_again()

    def postpone(self, action: Callable[[], Any]) -> None:
        """Run an action of the kernel when the process runs again."""
        self._postponed.append(action)

    def send_signal(self, number: int) -> None:
        """Send a signal, such as ``signal.SIGTERM``; its handler runs on the main thread."""
        if number == signal.SIGKILL:
            self.kill()
        elif number == signal.SIGSTOP:
            self.stop()
        elif number == signal.SIGCONT:
            self.proceed()
        elif number and self.handler(number) != signal.SIG_IGN:
            if self.handler(number) != signal.SIG_DFL:
                self.interrupt(lambda: self.handle(number))
            elif self.is_stopped:
                self.postpone(lambda: self.send_signal(number))
            elif number not in _IGNORED:
                self.exit(-number)

    def interrupt(self, action: Callable[[], Any]) -> None:
        """Run an action on the main thread where it waits, like a signal handler; it may raise or sleep."""
        self.interrupts.append(action)
        if self._threads:
            self._threads[0].wake()

    def handler(self, number: int) -> Any:
        """Return the handler of a signal. Python handles SIGINT as soon as the program runs."""
        is_interrupt = number == signal.SIGINT and bool(self._threads)
        return self.handlers.get(number, signal.default_int_handler if is_interrupt else signal.SIG_DFL)

    def handle(self, number: int) -> None:
        """Handle a signal, on the main thread."""
        handler = self.handler(number)
        if callable(handler):
            handler(number, None)
        else:
            self.send_signal(number)

    def handle_interrupts(self, thread: Thread) -> None:
        """Let a thread that runs note the end of its process, and run the actions of :meth:`interrupt`."""
        if self.ended:
            self.refuse(thread)
        while self.interrupts and thread is self._threads[0]:
            self.interrupts.popleft()()
            if self.ended:
                self.refuse(thread)

    def settle(self) -> None:
        """Let the running thread note what has just happened to its process: end, stop, signals."""
        thread = running()
        if self.is_suspended and not self.ended:
            thread.wait(self.kernel.now)
        self.handle_interrupts(thread)


class _Here(_local):
    """What runs now in the real thread of the simulation; other real threads run nothing simulated."""

    process: Process | None = None
    """The process whose code runs; ``None`` for the code of the simulation itself."""
    thread: Thread | None = None


here = _Here()


def running() -> Thread:
    """Return the thread that runs now. Raises RuntimeError outside of simulated programs."""
    if here.thread is None:
        raise RuntimeError("only simulated programs can do this: start them with Simulation.start")
    return here.thread


def running_process() -> Process:
    """Return the process that runs now. Raises RuntimeError outside of simulated programs."""
    if here.process is None:
        raise RuntimeError("only simulated programs can do this: start them with Simulation.start")
    return here.process


def in_process(simulated: Callable[..., Any], real: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function that does one thing in a simulated process, and the real one elsewhere."""

    def call(*arguments: Any, **options: Any) -> Any:
        process = here.process
        if process is None:
            return real(*arguments, **options)
        return simulated(process, *arguments, **options)

    return call
