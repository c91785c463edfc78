"""Guard conditions: events that an application triggers itself."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from rclpy._handle import EntityHandle, ignore_change
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidHandle

if TYPE_CHECKING:
    from rclpy.context import Context


class GuardConditionHandle(EntityHandle["GuardCondition"]):
    """A guard condition for a waitable that waits for it."""

    def trigger_guard_condition(self) -> None:
        """Trigger the guard condition; may be called from any thread."""
        self._rclpy_entity.trigger()


class GuardCondition:
    """Runs its callback on the executor after :meth:`trigger`; several triggers may cause one call."""

    def __init__(
        self,
        callback: Callable[[], Any] | None,
        callback_group: CallbackGroup | None,
        context: Context | None = None,
    ) -> None:
        """Create a guard condition; usually, :meth:`rclpy.node.Node.create_guard_condition` does."""
        self.callback = callback
        self.callback_group = callback_group
        self._context = context
        self._rclpy_numbers = itertools.count(1)
        self._rclpy_last_trigger = 0
        self._rclpy_last_call = 0  # the trigger that caused it
        self._rclpy_destroyed = False
        self._rclpy_on_change: Callable[[], None] = ignore_change

    @property
    def handle(self) -> GuardConditionHandle:
        """A handle for the guard condition. Raises InvalidHandle if it was destroyed."""
        self._rclpy_check_usable()
        return GuardConditionHandle(self)

    def _rclpy_check_usable(self) -> None:
        if self._rclpy_destroyed:
            raise InvalidHandle("cannot use a guard condition that was destroyed")

    def trigger(self) -> None:
        """Make the callback run; may be called from any thread."""
        self._rclpy_check_usable()
        self._rclpy_last_trigger = next(self._rclpy_numbers)
        self._rclpy_on_change()

    def destroy(self) -> None:
        """Destroy it. :meth:`rclpy.node.Node.destroy_guard_condition` also removes it from the node."""
        self._rclpy_destroyed = True

    # The interface that executors use for every entity.

    def _rclpy_is_ready(self) -> bool:
        return self._rclpy_last_trigger != self._rclpy_last_call and not self._rclpy_destroyed

    def _rclpy_take(self) -> tuple[()] | None:
        if not self._rclpy_is_ready():
            return None
        self._rclpy_last_call = self._rclpy_last_trigger
        return ()

    def _rclpy_execute(self, taken: tuple[()]) -> Any:
        return None if self.callback is None else self.callback()
