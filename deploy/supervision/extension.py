"""Extends supervisord through its own extension point (plugin.py).

- It adds to each program's state how often it was started and how it ended (RPC `arm.programs`).
- It kills a sentinel that has stopped asking for them (RPC `arm.watch`).
- It survives a full disk and a log that cannot be opened: only the affected lines are lost.
- It looks after its children at each signal, at once after each change, and every 100 ms while one of them
  starts, stops or waits: a killed service would start again only after 1-2 s otherwise. It sleeps in between.
- It locks the run directory, so that no cleaner of /tmp empties it.
- It removes the parameter file at an orderly shutdown, so no terminal starts the system again.

It runs inside supervisord, so it must not fail: it does nothing else.
"""

from __future__ import annotations

import fcntl
import json
import os
import signal
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any

from supervisor import events, loggers
from supervisor.loggers import RotatingFileHandler
from supervisor.rpcinterface import make_main_rpcinterface
from supervisor.states import ProcessStates, SupervisorStates, getProcessStateDescription

from deploy.supervision import manifest, prefork
from deploy.supervision.run_directory import PARAMETERS
from interfaces.plain_text import PlainBytes

REPLACED = {
    "supervisor.loggers.RotatingFileHandler": "a log that cannot be written ends supervisord, or keeps a"
    " program from its start; no setting names another class",
    "supervisor.options.ServerOptions.execve": "a new interpreter takes most of a restart;"
    " a subclass of ServerOptions would need a command of our own in place of `supervisord`",
    "supervisor.poller.Poller.poll": "supervisord acts on a change with its next look, up to 1 s later;"
    " an event only follows the change, and none follows a signal",
}
"""The names of supervisor that this module replaces, and why no event and no RPC interface can do it.

Read again with each version: a test compares :data:`VERSION` with the one that is installed.
"""
VERSION = "4.3.0"
"""The supervisor that these names belong to."""
LONGEST_WAIT = 0.1  # s, while the state of a program changes with time
_CHANGING = (ProcessStates.STARTING, ProcessStates.BACKOFF, ProcessStates.STOPPING)
_ENDS = (events.ProcessStateExitedEvent, events.ProcessStateBackoffEvent)
SENTINEL_START_TIMEOUT = 30.0  # s until its first call, even on a machine that is starting a fleet
SENTINEL_TIMEOUT = 3.0  # s between its calls


class LossyLog(RotatingFileHandler):  # type: ignore[misc]
    """A plain log file, which drops lines that it cannot write.

    Its base class raises where a file cannot be opened, and then the program does not start; it raises where
    a file cannot be rolled over, which ends supervisord; and it logs errors to the same full disk.
    """

    def __init__(self, filename: str, *arguments: Any) -> None:
        super().__init__(os.devnull, *arguments)  # opens always
        self.baseFilename = filename
        self.plain = PlainBytes()
        with suppress(OSError):
            self.reopen()

    def reopen(self) -> None:
        """Open the file again; make its directory again if it was removed. Raises OSError."""
        self.close()
        Path(self.baseFilename).parent.mkdir(parents=True, exist_ok=True)
        super().reopen()

    def emit(self, record: Any) -> None:
        try:
            if self.stream.closed:
                self.reopen()
            if isinstance(record.msg, bytes):  # what a program has written
                record.msg = self.plain(record.msg)
            super().emit(record)
        except OSError:
            self.closed = self.stream.closed  # a failed rollover leaves it closed

    def handleError(self) -> None:
        """Report nothing."""


class ArmInterface:
    def __init__(self, supervisord: Any) -> None:
        self._supervisord = supervisord
        self._starts: Counter[str] = Counter()
        self._started: dict[str, float] = {}  # [s, monotonic clock]: laststart would follow the time of day
        self._ended: dict[str, float] = {}  # the same clock
        self._away: dict[str, float] = {}  # [s] from the last end to the next start
        self._changed = False
        self._exits: dict[str, str] = {}
        self._guarded = (0, 0.0)  # the sentinel's pid, and the deadline of its next call
        self._clock = 0.0  # [s]; stands still while supervisord is kept from running
        self._polled = time.monotonic()
        self._wait = 0.0  # of the last poll [s]
        self._poller = supervisord.options.poller
        self._poll = self._poller.poll
        self._poller.poll = self._poll_briefly
        self._signals = -1
        events.subscribe(events.ProcessStateEvent, self._on_change)
        events.subscribe(events.SupervisorStoppingEvent, self._on_stopping)

    def wake_at_signals(self) -> None:
        """Let each signal end the wait of supervisord: Python itself would continue it."""
        self._signals, writing = os.pipe()
        os.set_blocking(writing, False)
        signal.set_wakeup_fd(writing, warn_on_full_buffer=False)
        self._poller.register_readable(self._signals)

    def programs(self) -> str:
        """The fields of `Program` for each program, in JSON: values of XML-RPC cost three times as much."""
        rows = [
            {
                "name": name,
                "state": getProcessStateDescription(process.get_state()),
                "pid": process.pid,
                "uptime": time.monotonic() - self._started[name] if process.pid else 0.0,
                "restarts": max(0, self._starts[name] - 1),
                "exit": self._exits.get(name, ""),
                "error": process.spawnerr or "",
                "away": self._away.get(name, 0.0),
            }
            for name, process in self._processes().items()
        ]
        return json.dumps(rows)

    def watch(self) -> str:
        """The same for the sentinel; each call is its sign of life."""
        self._guarded = (self._processes()[manifest.sentinel()].pid, self._clock + SENTINEL_TIMEOUT)
        return self.programs()

    def _processes(self) -> dict[str, Any]:
        groups = self._supervisord.process_groups.values()
        return {name: process for group in groups for name, process in group.processes.items()}

    def _guard(self) -> None:
        """Kill the sentinel if it hangs; as its parent, supervisord cannot mistake its pid."""
        sentinel = self._processes().get(manifest.sentinel())
        if sentinel is None or sentinel.get_state() not in (ProcessStates.STARTING, ProcessStates.RUNNING):
            return
        pid, deadline = self._guarded
        if pid != sentinel.pid:
            self._guarded = (sentinel.pid, self._clock + SENTINEL_START_TIMEOUT)
        elif self._clock > deadline:
            self._guarded = (sentinel.pid, self._clock + SENTINEL_START_TIMEOUT)
            with suppress(ProcessLookupError):
                os.kill(sentinel.pid, signal.SIGKILL)

    def _on_change(self, event: Any) -> None:
        self._changed = True
        name = event.process.config.name
        if isinstance(event, events.ProcessStateStartingEvent):
            self._starts[name] += 1
            self._started[name] = time.monotonic()
            self._away[name] = self._started[name] - self._ended.get(name, self._started[name])
        elif isinstance(event, _ENDS):
            self._ended[name] = time.monotonic()
            # supervisord does not keep the number of a signal, nor the code of a process that ended early.
            code = event.process.exitstatus
            early = isinstance(event, events.ProcessStateBackoffEvent)
            self._exits[name] = "early" if early else "killed by a signal" if code == -1 else f"code {code}"

    def _on_stopping(self, event: Any) -> None:
        if self._supervisord.options.mood == SupervisorStates.SHUTDOWN:  # not at a reload
            with suppress(OSError):
                os.remove(PARAMETERS)

    def _poll_briefly(self, timeout: float) -> Any:
        # supervisord acts on a change only after its next poll: after a change this poll must not wait.
        now = time.monotonic()
        self._clock += min(now - self._polled, self._wait + LONGEST_WAIT)
        self._polled = now
        self._guard()
        changes = any(process.get_state() in _CHANGING for process in self._processes().values())
        self._wait = 0.0 if self._changed else min(timeout, LONGEST_WAIT) if changes else timeout
        self._changed = False
        readable, writable = self._poll(self._wait)
        if self._signals in readable:
            readable.remove(self._signals)
            os.read(self._signals, 4096)
        return readable, writable


def lock_directory() -> None:
    """Lock the run directory until supervisord ends: systemd-tmpfiles leaves it alone (tmpfiles.d(5))."""
    with suppress(OSError):  # a file system without locks
        fcntl.flock(os.open(os.curdir, os.O_RDONLY), fcntl.LOCK_SH)


def make_main_interface(supervisord: Any, **shared: str) -> Any:
    """Return supervisor's own interface, which takes no settings.

    :param shared: what [DEFAULT] gives to all sections.
    """
    return make_main_rpcinterface(supervisord)


def make_interface(supervisord: Any, **config: str) -> ArmInterface:
    loggers.RotatingFileHandler = LossyLog  # for the programs: each start opens its log
    for handler in supervisord.options.logger.handlers:
        if isinstance(handler, RotatingFileHandler):  # in the foreground, there is a handler for the terminal
            handler.__class__ = LossyLog  # supervisord's own log is open already
            handler.plain = PlainBytes()
    lock_directory()
    prefork.import_libraries()
    supervisord.options.execve = prefork.executor(os.execve)
    arm = ArmInterface(supervisord)
    arm.wake_at_signals()
    return arm
