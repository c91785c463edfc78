"""What simulated programs wait for: conditions, guard conditions and wait sets."""

from __future__ import annotations

from rclpy_ground.interface import INFINITY
from rclpy_simulation.process import running
from rclpy_simulation.thread import BUSY_WAITS, Thread


class Condition:
    """A condition that wait sets wait for."""

    __slots__ = ("is_triggered", "wait_sets")

    def __init__(self) -> None:
        self.is_triggered = False
        self.wait_sets: list[WaitSet] = []

    def set(self) -> None:
        if not self.is_triggered:
            self.is_triggered = True
            for wait_set in self.wait_sets:
                wait_set.note(self)

    def clear(self) -> None:
        if self.is_triggered:
            self.is_triggered = False
            for wait_set in self.wait_sets:
                wait_set.note(self)

    def close(self) -> None:
        """Take the condition out of all wait sets."""
        for wait_set in list(self.wait_sets):
            wait_set.detach(self)


class GuardCondition:
    def __init__(self) -> None:
        self.handle = Condition()

    def trigger(self) -> None:
        self.handle.set()

    def take(self) -> None:
        self.handle.clear()

    def close(self) -> None:
        self.handle.close()


class WaitSet:
    """Waits for any of the attached conditions, in virtual time."""

    def __init__(self) -> None:
        self.closed = False
        self._tokens: dict[Condition, int] = {}
        self._triggered: dict[Condition, int] = {}
        self._waiting: Thread | None = None
        self._immediate = 0  # waits in a row that have ended at once

    def attach(self, handle: Condition, token: int) -> bool:
        """Add a condition, which ``wait`` reports as ``token``."""
        self._tokens[handle] = token
        handle.wait_sets.append(self)
        self.note(handle)
        return True

    def detach(self, handle: Condition) -> None:
        if self._tokens.pop(handle, None) is not None:
            self._triggered.pop(handle, None)
            handle.wait_sets.remove(self)

    def note(self, handle: Condition) -> None:
        if handle.is_triggered:
            self._triggered[handle] = self._tokens[handle]
            if self._waiting is not None:
                self._waiting.wake()
        else:
            self._triggered.pop(handle, None)

    def wait(self, timeout: int) -> list[int]:
        """Wait at most ``timeout`` [ns]; return the tokens that are triggered."""
        if self._triggered or timeout <= 0 or self.closed:
            self._immediate += 1
            if self._immediate > BUSY_WAITS:  # a busy loop lets time pass
                self._immediate = 0
                running().pause()
        else:
            self._immediate = 0
            thread = self._waiting = running()
            now = thread.process.present
            try:
                thread.wait(None if timeout >= INFINITY - now else now + timeout)
            finally:
                self._waiting = None
        return [] if self.closed else list(self._triggered.values())

    def close(self) -> None:
        """Close the wait set and end its waits."""
        self.closed = True
        for handle in list(self._tokens):
            self.detach(handle)
        if self._waiting is not None:
            self._waiting.wake()
