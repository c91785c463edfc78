"""Contexts: what a process has of a domain, and what its threads wait with."""

from __future__ import annotations

import itertools
import os
import threading
import weakref
from typing import Protocol

from rclpy_ground import choice, process
from rclpy_ground.genuine import RCLError, genuine
from rclpy_ground.handles import Destroyable
from rclpy_ground.interface import Handle, Participant
from rclpy_ground.rcl import Arguments


class Waitable(Protocol):
    """What a thread waits for."""

    pointer: int
    condition: Handle


class Waiter:
    """The wait set of a thread. What is attached stays for the next wait: it is mostly the same."""

    def __init__(self, context: Context) -> None:
        self._guard = context.guard
        self._wait_set = choice.ground.create_wait_set()
        self._wait_set.attach(self._guard.handle, 0)
        self._attached: dict[int, Handle] = {}
        self._last: list[int] = []

    def wait(self, pointers: list[int], wanted: list[Waitable], timeout: int) -> list[int]:
        """Wait for objects at most ``timeout`` [ns]; return the pointers of those that are ready.

        A change of the context ends the wait, too: its shutdown, or a timer that was set again.
        """
        if pointers != self._last:
            self._last = [*pointers]
            self._attach({each.pointer: each.condition for each in wanted})
        found = self._wait_set.wait(timeout)
        if 0 in found:
            self._guard.take()
        return found

    def _attach(self, wanted: dict[int, Handle]) -> None:
        attached = self._attached
        for pointer in [pointer for pointer in attached if pointer not in wanted]:
            self._wait_set.detach(attached[pointer])
        for pointer, handle in wanted.items():
            if pointer not in attached:
                self._wait_set.attach(handle, pointer)
        self._attached = wanted


class Context(Destroyable):
    def __init__(self, args: list[str], domain_id: int) -> None:
        if domain_id == genuine.RCL_DEFAULT_DOMAIN_ID:
            domain_id = _domain_of_environment()
        self.enclave = _enclave(args)
        choice.ground.check(domain_id, self.enclave)
        self.arguments = Arguments(args, domain_id)
        super().__init__()
        self.is_valid = True
        self.guard = choice.ground.create_guard_condition()
        self.service_ids = itertools.count(1)
        self._domain_id = domain_id
        self._waiters: dict[int, Waiter] = {}  # by thread
        self._participant: Participant | None = None
        self._nodes = 0
        self._lock = threading.RLock()
        choice.ground.watch_signals()  # those so far do not concern this context
        process.current.contexts.append(weakref.ref(self))

    def get_domain_id(self) -> int:
        return self._domain_id

    def ok(self) -> bool:
        return self.is_valid

    def shutdown(self) -> None:
        if not self.is_valid:
            raise RCLError("failed to shutdown: rcl_shutdown already called on the given context")
        self.invalidate()

    def invalidate(self) -> None:
        if self.is_valid:
            self.is_valid = False
            self.wake()

    def wake(self) -> None:
        """End the waits of its threads."""
        self.guard.trigger()

    def waiter(self) -> Waiter:
        """Return what the running thread waits with."""
        thread = threading.get_ident()
        found = self._waiters.get(thread)
        if found is None:
            found = self._waiters[thread] = Waiter(self)
        return found

    def join(self) -> Participant:
        """Return the participant for one more node."""
        with self._lock:
            if self._participant is None:
                self._participant = choice.ground.create_participant(self._domain_id, self.enclave)
            self._nodes += 1
            return self._participant

    def leave(self) -> None:
        """Let a node go; with the last one, its participant."""
        with self._lock:
            self._nodes -= 1
            if not self._nodes:
                self.leave_domain()

    def leave_domain(self) -> None:
        participant, self._participant = self._participant, None
        if participant is not None:
            participant.close()


def _domain_of_environment() -> int:
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal():
        raise RCLError(f"ROS_DOMAIN_ID is not an integral number: {text}")
    return int(text)


def _enclave(args: list[str]) -> str:
    for option, value in itertools.pairwise(args):
        if option in ("-e", "--enclave"):
            return value
    return "/"
