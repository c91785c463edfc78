"""What the substitute keeps for a process. A simulation exchanges ``current`` when it switches processes."""

from __future__ import annotations

import weakref
from typing import Any, Protocol

INFO = 20


class _Context(Protocol):
    is_valid: bool

    def invalidate(self) -> None: ...

    def wake(self) -> None: ...

    def leave_domain(self) -> None: ...


class _Guard(Protocol):
    def trigger_guard_condition(self) -> None: ...


class _Publisher(Protocol):
    is_wanted: bool
    node: Any

    def publish(self, message: Any) -> None: ...


class ProcessState:
    def __init__(self) -> None:
        self.contexts: list[weakref.ref[_Context]] = []
        self.signal_guards: dict[_Guard, None] = {}
        self.signal_options = 0
        self.previous_handlers: dict[int, Any] = {}
        self.default_level = INFO
        self.levels: dict[str, int] = {}
        """The levels of loggers that have one of their own."""
        self.rosout: dict[str, weakref.ref[_Publisher]] = {}
        """The publishers of ``/rosout`` by the name of their logger."""
        self.subloggers: dict[str, tuple[weakref.ref[_Publisher], int]] = {}
        """Publishers of ``/rosout`` and the number of their users, by the name of a child logger."""

    def leave_domains(self) -> None:
        """Close all participants: the process ends in order."""
        for reference in self.contexts:
            if (context := reference()) is not None:
                context.leave_domain()


current = ProcessState()
