"""Goals of actions as observables."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.action.client import ClientGoalHandle
from rclpy.task import Future
from reactivex import Observable, abc
from reactivex.disposable import Disposable


class GoalError(Exception):
    """A goal that did not succeed.

    :ivar result: what the server returned, of the action's result type; ``None`` if it returned nothing.
    """

    def __init__(self, message: str, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


class GoalRejected(GoalError):
    """The server did not accept the goal."""


class GoalAborted(GoalError):
    """The server gave the goal up."""


class GoalCanceled(GoalError):
    """Another client cancelled the goal."""


class GoalUnknown(GoalError):
    """The server does not know the goal any more, for example because it was restarted."""


_FAILURES: dict[int, tuple[type[GoalError], str]] = {
    GoalStatus.STATUS_ABORTED: (GoalAborted, "aborted the goal"),
    GoalStatus.STATUS_CANCELED: (GoalCanceled, "cancelled the goal"),
}


def execution(client: ActionClient, name: str, goal: Any, scheduler: abc.SchedulerBase) -> Observable[Any]:
    """Send a goal when subscribed; emit feedback and the result, or a :class:`GoalError`."""

    def subscribe(observer: abc.ObserverBase[Any], _: abc.SchedulerBase | None = None) -> abc.DisposableBase:
        execution = _Execution(name, observer, scheduler)
        execution.begin(client, goal)
        return Disposable(execution.cancel)

    return Observable(subscribe)


class _Execution:
    def __init__(self, name: str, observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase) -> None:
        self._name = name
        self._observer = observer
        self._scheduler = scheduler
        self._lock = threading.Lock()  # any thread may cancel
        self._cancelled = False
        self._accepted: ClientGoalHandle | None = None  # while the server executes the goal

    def begin(self, client: ActionClient, goal: Any) -> None:
        sent = client.send_goal_async(goal, lambda message: self._observer.on_next(message.feedback))
        self._then(sent, self._answered)

    def cancel(self) -> None:
        """Ask the server to cancel the goal, now or when it accepts the goal."""
        with self._lock:
            self._cancelled = True
            accepted, self._accepted = self._accepted, None
        if accepted is not None:
            accepted.cancel_goal_async()

    def _then(self, future: Future, action: Callable[[Any], None]) -> None:
        # A future's callbacks belong to no callback group; the scheduler's actions run in the node's.
        future.add_done_callback(lambda future: self._scheduler.schedule(lambda *_: action(future.result())))

    def _answered(self, handle: ClientGoalHandle) -> None:
        if not handle.accepted:
            self._observer.on_error(GoalRejected(f"the server of {self._name} rejected the goal"))
            return
        with self._lock:
            cancelled = self._cancelled
            if not cancelled:
                self._accepted = handle
        if cancelled:
            handle.cancel_goal_async()
        # Even of a cancelled goal: only with its result, rclpy forgets the feedback's callback.
        self._then(handle.get_result_async(), self._ended)

    def _ended(self, response: Any) -> None:
        with self._lock:
            self._accepted = None  # there is nothing left to cancel
        if response.status == GoalStatus.STATUS_SUCCEEDED:
            self._observer.on_next(response.result)
            self._observer.on_completed()
            return
        failure, did = _FAILURES.get(response.status, (GoalUnknown, "does not know the goal any more"))
        self._observer.on_error(failure(f"the server of {self._name} {did}", response.result))
