"""Guard conditions: what an application triggers itself."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rclpy._handle import Handle
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidHandle

if TYPE_CHECKING:
    from rclpy.context import Context


class GuardCondition:
    """Runs its callback on the executor after each :meth:`trigger`; several triggers may become one."""

    def __init__(
        self,
        callback: Callable[[], Any] | None,
        callback_group: CallbackGroup | None,
        context: Context | None = None,
    ) -> None:
        """Create one; :meth:`rclpy.node.Node.create_guard_condition` is the usual way."""
        self.callback = callback
        self.callback_group = callback_group
        self._context = context
        self._handle = Handle()
        self._triggered = threading.Event()
        self._destroyed = False
        self._on_change: Callable[[], None] = lambda: None

    @property
    def handle(self) -> Handle:
        """What stands for the guard condition. Raises InvalidHandle when it was destroyed."""
        self._check_usable()
        return self._handle

    def _check_usable(self) -> None:
        if self._destroyed:
            raise InvalidHandle("cannot use a guard condition that was destroyed")

    def trigger(self) -> None:
        """Let the callback run; from any thread."""
        self._check_usable()
        self._triggered.set()
        self._on_change()

    def destroy(self) -> None:
        """End it; whoever created it should use :meth:`rclpy.node.Node.destroy_guard_condition`."""
        self._destroyed = True

    # What the executor asks of everything it waits for.

    def _is_ready(self) -> bool:
        """Whether it was triggered and its callback has not run yet."""
        return self._triggered.is_set() and not self._destroyed

    def _take(self) -> tuple[()] | None:
        if not self._is_ready():
            return None
        self._triggered.clear()
        return ()

    def _execute(self, taken: tuple[()]) -> Any:
        return None if self.callback is None else self.callback()
