"""The states of the goals of an action server (design.ros2.org/articles/actions.html, Goal States)."""

from __future__ import annotations

from typing import Any, Protocol

from rclpy_ground.genuine import RCLError
from rclpy_ground.handles import Destroyable

_ACCEPTED, _EXECUTING, _CANCELING, _SUCCEEDED, _CANCELED, _ABORTED = range(1, 7)
_STATES = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
_ACTIVE = (_ACCEPTED, _EXECUTING, _CANCELING)
_EVENTS = ("EXECUTE", "CANCEL_GOAL", "SUCCEED", "ABORT", "CANCELED")
_NEXT = {
    (_ACCEPTED, "EXECUTE"): _EXECUTING,
    (_ACCEPTED, "CANCEL_GOAL"): _CANCELING,
    (_EXECUTING, "CANCEL_GOAL"): _CANCELING,
    (_EXECUTING, "SUCCEED"): _SUCCEEDED,
    (_EXECUTING, "ABORT"): _ABORTED,
    (_CANCELING, "SUCCEED"): _SUCCEEDED,
    (_CANCELING, "ABORT"): _ABORTED,
    (_CANCELING, "CANCELED"): _CANCELED,
}


class _Server(Protocol):
    def now(self) -> int: ...

    def accept(self, handle: ActionGoalHandle) -> None: ...


class ActionGoalHandle(Destroyable):
    """A goal that a server has accepted."""

    def __init__(self, server: _Server, info: Any) -> None:
        from builtin_interfaces.msg import Time

        super().__init__()
        self._server = server
        self.accepted = server.now()
        """When it was accepted, by the server's clock [ns]."""
        seconds, nanoseconds = divmod(self.accepted, 10**9)
        self.info = type(info)(goal_id=info.goal_id, stamp=Time(sec=seconds, nanosec=nanoseconds))
        self.status = _ACCEPTED
        self.ended: int | None = None
        """When it reached its last state, by the server's clock [ns]."""
        server.accept(self)

    @property
    def key(self) -> bytes:
        return bytes(self.info.goal_id.uuid)

    def get_status(self) -> int:
        return self.status

    def is_active(self) -> bool:
        return self.status in _ACTIVE

    def is_cancelable(self) -> bool:
        return (self.status, "CANCEL_GOAL") in _NEXT

    def update_goal_state(self, event: Any) -> None:
        name = _EVENTS[int(event)]
        following = _NEXT.get((self.status, name))
        if following is None:
            raise RCLError(
                "Failed to update goal state: goal_handle attempted invalid transition"
                f" from state {_STATES[self.status]} with event {name}"
            )
        self.status = following
        if following not in _ACTIVE:
            self.ended = self._server.now()
