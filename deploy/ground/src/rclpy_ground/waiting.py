"""Guard conditions, and the wait set with which rclpy's executors wait."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from typing import Any

from rclpy_ground import choice
from rclpy_ground.contexts import Context, Waitable
from rclpy_ground.genuine import RCLError
from rclpy_ground.handles import Destroyable
from rclpy_ground.interface import INFINITY
from rclpy_ground.process import ProcessState
from rclpy_ground.timers import Timer

_moments = itertools.count(1)


class GuardCondition(Destroyable):
    is_of_executor = False
    """Whether it only lets an executor look at its entities again; see :mod:`rclpy_ground.changes`."""

    def __init__(self, context: Context) -> None:
        if not context.is_valid:
            raise RCLError("failed to create guard condition: the context is invalid")
        super().__init__()
        self._guard = choice.ground.create_guard_condition()
        self.condition = self._guard.handle
        self.take = self._guard.take
        self.triggered = 0
        """The moment of the last trigger."""
        self.process: ProcessState | None = None
        """Whose signals trigger it. Its last user may be freed while another process runs."""

    def trigger_guard_condition(self) -> None:
        self.triggered = next(_moments)
        self._guard.trigger()

    def destroy(self) -> None:
        self._guard.close()


_KINDS = ("subscription", "guard_condition", "timer", "client", "service", "event")


def _adder(kind: str) -> Callable[[WaitSet, Any], int]:
    def add(self: WaitSet, entity: Any) -> int:
        """Add an entity; return its place among those of its kind."""
        entities = self._entities.get(kind)
        if entities is None:
            entities = self._entities[kind] = []
        entities.append(entity)
        self._wanted.append(entity)
        self._pointers.append(entity.pointer)
        return len(entities) - 1

    return add


class WaitSet(Destroyable):
    def __init__(self, *arguments: Any) -> None:
        """Create a wait set; the last argument is its context, those before are numbers of entities."""
        super().__init__()
        self._context: Context = arguments[-1]
        self._created = next(_moments)
        self.clear_entities()

    def clear_entities(self) -> None:
        self._entities: dict[str, list[Any]] = {}
        self._wanted: list[Waitable] = []
        self._pointers: list[int] = []
        self._ready: list[int] = []

    add_subscription = _adder("subscription")
    add_client = _adder("client")
    add_service = _adder("service")
    add_guard_condition = _adder("guard_condition")
    add_event = _adder("event")

    def add_timer(self, timer: Timer) -> int:
        timers = self._entities.setdefault("timer", [])
        timers.append(timer)
        clock = timer.clock
        if clock.override is not None:
            self._wanted.append(clock)
            self._pointers.append(clock.pointer)
        return len(timers) - 1

    def wait(self, timeout: int) -> None:
        """Wait for an entity at most ``timeout`` [ns], endlessly if it is negative."""
        guards: list[GuardCondition] = self._entities.get("guard_condition", [])
        for guard in guards:
            if guard.is_of_executor and guard.triggered < self._created:
                guard.take()  # the executor has looked since
        timers: list[Timer] = self._entities.get("timer", [])
        limit = INFINITY if timeout < 0 else timeout
        now = time.monotonic_ns()
        for timer in timers:
            if (remaining := timer.remaining(now)) < limit:
                limit = remaining
        ready = self._context.waiter().wait(self._pointers, self._wanted, max(0, limit))
        for guard in guards:
            if guard.pointer in ready:
                guard.take()
        for timer in timers:
            if timer.clock.pointer in ready:
                timer.clock.note_taken()
            if timer.is_timer_ready():
                ready.append(timer.pointer)
        self._ready = ready

    def is_ready(self, kind: str, index: int) -> bool:
        entities = self._of_kind(kind)
        if not 0 <= index < len(entities):
            raise IndexError("wait set index too big")
        entity = entities[index]
        return entity.look() if kind == "event" else entity.pointer in self._ready

    def get_ready_entities(self, kind: str) -> list[int]:
        ready = self._ready
        return [each.pointer for each in self._of_kind(kind) if each.pointer in ready] if ready else []

    def _of_kind(self, kind: str) -> list[Any]:
        if kind not in _KINDS:
            raise RuntimeError(f"'{kind}' is not a known entity")
        return self._entities.get(kind, [])
