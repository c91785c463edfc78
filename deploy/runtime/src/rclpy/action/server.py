"""Action servers: they accept, execute and cancel goals.

A goal goes through the states of ``action_msgs/msg/GoalStatus`` (design.ros2.org, "Actions"). The server
keeps a goal and its result for some time after its end, for clients that ask late.
"""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable
from enum import Enum
from functools import partial
from typing import TYPE_CHECKING, Any

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from rclpy.action._endpoints import ActionWaitable, creation, uuid_bytes
from rclpy.callback_groups import CallbackGroup
from rclpy.constants import S_TO_NS
from rclpy.exceptions import InvalidHandle, RCLError
from rclpy.executors import await_or_execute
from rclpy.qos import QoSProfile, qos_profile_action_status_default, qos_profile_services_default
from rclpy.task import Future, Task
from rclpy.timer import Timer
from rclpy.waitable import NumberOfEntities

if TYPE_CHECKING:
    from rclpy._service_wire import RequestId
    from rclpy.impl.rcutils_logger import RcutilsLogger
    from rclpy.node import Node
    from rclpy.service import Service
    from unique_identifier_msgs.msg import UUID


class GoalResponse(Enum):
    REJECT = 1
    ACCEPT = 2


class CancelResponse(Enum):
    """The answers to a request to cancel a goal."""

    REJECT = 1
    ACCEPT = 2


class GoalEvent(Enum):
    """The events that change the state of a goal."""

    EXECUTE = 0
    CANCEL_GOAL = 1
    SUCCEED = 2
    ABORT = 3
    CANCELED = 4


_ACCEPTED = GoalStatus.STATUS_ACCEPTED
_EXECUTING = GoalStatus.STATUS_EXECUTING
_CANCELING = GoalStatus.STATUS_CANCELING
_ACTIVE = (_ACCEPTED, _EXECUTING, _CANCELING)
_TRANSITIONS = {
    (_ACCEPTED, GoalEvent.EXECUTE): _EXECUTING,
    (_ACCEPTED, GoalEvent.CANCEL_GOAL): _CANCELING,
    (_EXECUTING, GoalEvent.CANCEL_GOAL): _CANCELING,
    (_EXECUTING, GoalEvent.SUCCEED): GoalStatus.STATUS_SUCCEEDED,
    (_EXECUTING, GoalEvent.ABORT): GoalStatus.STATUS_ABORTED,
    (_CANCELING, GoalEvent.SUCCEED): GoalStatus.STATUS_SUCCEEDED,
    (_CANCELING, GoalEvent.ABORT): GoalStatus.STATUS_ABORTED,
    (_CANCELING, GoalEvent.CANCELED): GoalStatus.STATUS_CANCELED,
}
_STATE_NAMES = {
    value: name.removeprefix("STATUS_")
    for name, value in vars(GoalStatus).items()
    if name.startswith("STATUS_")
}


class ServerGoalHandle:
    """A goal that the server has accepted."""

    def __init__(self, action_server: ActionServer, goal_info: GoalInfo, goal_request: Any) -> None:
        """Create the handle; only action servers do."""
        self._action_server = action_server
        self._goal_info = goal_info
        self._goal_request = goal_request
        self._rclpy_state: int = _ACCEPTED
        self._rclpy_ended_at = 0  # [ns] of the node's clock
        self._rclpy_destroyed = False
        self._lock = threading.Lock()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ServerGoalHandle) and self.goal_id == other.goal_id

    def __ne__(self, other: object) -> bool:
        return not self == other

    @property
    def request(self) -> Any:
        """The goal, of the action's goal type."""
        return self._goal_request

    @property
    def goal_id(self) -> UUID:
        return self._goal_info.goal_id

    @property
    def is_active(self) -> bool:
        return self.status in _ACTIVE

    @property
    def is_cancel_requested(self) -> bool:
        """Whether the server has accepted a request to cancel the goal, which has not ended yet."""
        return self.status == _CANCELING

    @property
    def status(self) -> int:
        """The state of the goal, a constant of ``action_msgs/msg/GoalStatus``."""
        return GoalStatus.STATUS_UNKNOWN if self._rclpy_destroyed else self._rclpy_state

    def _update_state(self, event: GoalEvent) -> None:
        """Change the state and publish it. Raises RCLError if the state does not allow the event."""
        with self._lock:
            if self._rclpy_destroyed:
                return
            state = _TRANSITIONS.get((self._rclpy_state, event))
            if state is None:
                raise RCLError(
                    "Failed to update goal state: goal_handle attempted invalid transition from state"
                    f" {_STATE_NAMES[self._rclpy_state]} with event {event.name}"
                )
            if state not in _ACTIVE:
                self._rclpy_ended_at = self._action_server._rclpy_now()
            self._rclpy_state = state
            self._action_server._rclpy_publish_status()
            if state not in _ACTIVE:
                self._action_server.notify_goal_done()

    def execute(self, execute_callback: Callable[[ServerGoalHandle], Any] | None = None) -> None:
        """Run ``execute_callback``, by default that of the server, on the node's executor."""
        # A goal may be cancelled before its execution. The callback finds out through is_cancel_requested.
        if not self.is_cancel_requested:
            self._update_state(GoalEvent.EXECUTE)
        self._action_server.notify_execute(self, execute_callback)

    def publish_feedback(self, feedback: Any) -> None:
        """Publish feedback on the goal. Raises TypeError if it is not of the action's feedback type."""
        action_type = self._action_server.action_type
        if not isinstance(feedback, action_type.Feedback):
            raise TypeError(f"Expected {action_type.Feedback._TYPE_NAME}, got {feedback!r}")
        message = action_type.Impl.FeedbackMessage(goal_id=self.goal_id, feedback=feedback)
        with self._lock:
            if not self._rclpy_destroyed:
                self._action_server._rclpy_publish_feedback(message)

    def succeed(self) -> None:
        """Declare that the goal was reached. Raises RCLError if it was not being executed."""
        self._update_state(GoalEvent.SUCCEED)

    def abort(self) -> None:
        """Declare that the goal was not reached. Raises RCLError if it was not being executed."""
        self._update_state(GoalEvent.ABORT)

    def canceled(self) -> None:
        """Declare that the goal was cancelled. Raises RCLError without an accepted request to cancel it."""
        self._update_state(GoalEvent.CANCELED)

    def destroy(self) -> None:
        """Forget the goal: its state becomes unknown, and later changes have no effect."""
        with self._lock:
            self._rclpy_destroyed = True


def default_handle_accepted_callback(goal_handle: ServerGoalHandle) -> None:
    """Execute the goal."""
    goal_handle.execute()


def default_goal_callback(goal_request: Any) -> GoalResponse:
    """Accept all goals."""
    return GoalResponse.ACCEPT


def default_cancel_callback(cancel_request: Any) -> CancelResponse:
    """Cancel no goal."""
    return CancelResponse.REJECT


class ActionServer(ActionWaitable):
    def __init__(
        self,
        node: Node,
        action_type: Any,
        action_name: str,
        execute_callback: Callable[[ServerGoalHandle], Any],
        *,
        callback_group: CallbackGroup | None = None,
        goal_callback: Callable[[Any], Any] | None = default_goal_callback,
        handle_accepted_callback: Callable[[ServerGoalHandle], Any] | None = default_handle_accepted_callback,
        cancel_callback: Callable[[ServerGoalHandle], Any] | None = default_cancel_callback,
        goal_service_qos_profile: QoSProfile = qos_profile_services_default,
        result_service_qos_profile: QoSProfile = qos_profile_services_default,
        cancel_service_qos_profile: QoSProfile = qos_profile_services_default,
        feedback_pub_qos_profile: QoSProfile = QoSProfile(depth=10),  # noqa: B008
        status_pub_qos_profile: QoSProfile = qos_profile_action_status_default,
        result_timeout: float = 900,
    ) -> None:
        """Create an action server.

        :param node: the node, whose executor runs the callbacks.
        :param action_type: the type of the action.
        :param action_name: its name, with which the names of its topics and services begin.
        :param execute_callback: called with the handle of a goal; ends the goal and returns its result.
        :param callback_group: the group of the other callbacks; the node's default group if ``None``.
        :param goal_callback: called with a goal; returns a :class:`GoalResponse`.
        :param handle_accepted_callback: called with the handle of an accepted goal; executes it by default.
        :param cancel_callback: called with a goal's handle for a request to cancel it; returns a
            :class:`CancelResponse`.
        :param result_timeout: for how long a result is kept after the end of the goal [s].
        :raises TypeError: if ``execute_callback`` is not callable.
        :raises ValueError: if the name is invalid, or the timeout negative.
        """
        group = callback_group or node.default_callback_group
        super().__init__(group)
        self.register_handle_accepted_callback(handle_accepted_callback)
        self.register_goal_callback(goal_callback)
        self.register_cancel_callback(cancel_callback)
        self.register_execute_callback(execute_callback)
        if result_timeout < 0:
            raise ValueError("Failed to create action server: result_timeout must be non-negative")
        self._node = node
        self._action_type = action_type
        self._rclpy_lock = threading.RLock()
        self._goal_handles: dict[bytes, ServerGoalHandle] = {}
        self._result_futures: dict[bytes, Future] = {}
        self._rclpy_executions: set[Task] = set()
        self._rclpy_result_timeout = int(result_timeout * S_TO_NS)
        with creation(node, "action server", action_type, action_name, group) as endpoints:
            impl = action_type.Impl
            self._rclpy_goal_service = endpoints.service(
                impl.SendGoalService, "send_goal", goal_service_qos_profile
            )
            self._rclpy_cancel_service = endpoints.service(
                impl.CancelGoalService, "cancel_goal", cancel_service_qos_profile
            )
            self._rclpy_result_service = endpoints.service(
                impl.GetResultService, "get_result", result_service_qos_profile
            )
            self._rclpy_feedback = endpoints.publisher(
                impl.FeedbackMessage, "feedback", feedback_pub_qos_profile
            )
            self._rclpy_status = endpoints.publisher(impl.GoalStatusMessage, "status", status_pub_qos_profile)
        self._rclpy_endpoints = endpoints
        self._rclpy_expiry = Timer(
            self._rclpy_expire_goals,
            group,
            self._rclpy_result_timeout,
            node.get_clock(),
            context=node.context,
            autostart=False,
        )
        self._rclpy_expiry._rclpy_on_change = node._wake_executor
        # The interface that executors use for every entity.
        self._rclpy_handles = endpoints.handles()
        self._rclpy_timers = (self._rclpy_expiry,)
        node.add_waitable(self)

    @property
    def _rclpy_logger(self) -> RcutilsLogger:
        # Made for each message: the end of a logger takes a lock, which a garbage collection must not do.
        return self._node.get_logger().get_child("action_server")

    @property
    def action_type(self) -> Any:
        return self._action_type

    # Goals

    async def _rclpy_handle_goal_request(self, request: Any, request_id: RequestId) -> None:
        goal_uuid = uuid_bytes(request.goal_id)
        accepted = False
        if goal_uuid not in self._goal_handles:
            response = await await_or_execute(self._goal_callback, request.goal)
            if not isinstance(response, GoalResponse):
                self._rclpy_logger.warning(
                    "Goal request callback did not return a GoalResponse type. Rejecting goal."
                )
            accepted = response is GoalResponse.ACCEPT
        goal_info = GoalInfo(goal_id=request.goal_id, stamp=self._node.get_clock().now().to_msg())
        goal_handle = ServerGoalHandle(self, goal_info, request.goal)
        if accepted:
            with self._rclpy_lock:  # two requests with the same UUID may be handled in parallel
                accepted = self._goal_handles.setdefault(goal_uuid, goal_handle) is goal_handle
                if accepted:
                    self._result_futures[goal_uuid] = Future()
        answer = self._action_type.Impl.SendGoalService.Response(accepted=accepted)
        if accepted:
            answer.stamp = goal_info.stamp
        self._rclpy_respond(self._rclpy_goal_service, answer, request_id)
        if accepted:
            await await_or_execute(self._handle_accepted_callback, goal_handle)

    def notify_execute(
        self,
        goal_handle: ServerGoalHandle,
        execute_callback: Callable[[ServerGoalHandle], Any] | None,
    ) -> None:
        """Run an execute callback, or the registered one, for a goal on the node's executor."""
        executor = self._node.executor
        if executor is None:
            raise RuntimeError("cannot execute a goal: no executor spins the node of the action server")
        task = executor.create_task(
            self._execute_goal, execute_callback or self._execute_callback, goal_handle
        )
        self._rclpy_executions.add(task)
        task._rclpy_call_when_complete(lambda: self._rclpy_executions.discard(task))

    async def _execute_goal(
        self, execute_callback: Callable[[ServerGoalHandle], Any], goal_handle: ServerGoalHandle
    ) -> None:
        goal_uuid = uuid_bytes(goal_handle.goal_id)
        try:
            result = await await_or_execute(execute_callback, goal_handle)
        except Exception as error:
            self._rclpy_logger.error(f"Error raised in execute callback: {error}")
            traceback.print_exc()
            result = self._action_type.Result()
        if goal_handle.is_active:
            self._rclpy_logger.warning(f"Goal state not set, assuming aborted. Goal ID: {goal_uuid.hex()}")
            goal_handle.abort()
        if not isinstance(result, self._action_type.Result):
            expected = self._action_type.Result._TYPE_NAME
            self._rclpy_logger.error(f"The execute callback must return {expected}, not {result!r}")
            result = self._action_type.Result()
        response = self._action_type.Impl.GetResultService.Response(status=goal_handle.status, result=result)
        future = self._result_futures.get(goal_uuid)
        if future is not None:  # else the goal has expired meanwhile
            future.set_result(response)

    async def _rclpy_handle_cancel_request(self, request: Any, request_id: RequestId) -> None:
        return_code, goal_handles = self._rclpy_goals_to_cancel(request.goal_info)
        response = self._action_type.Impl.CancelGoalService.Response(return_code=return_code)
        for goal_handle in goal_handles:
            answer = await await_or_execute(self._cancel_callback, goal_handle)
            if answer is not CancelResponse.ACCEPT:
                continue
            try:
                goal_handle._update_state(GoalEvent.CANCEL_GOAL)
            except RCLError as error:  # the goal has ended meanwhile
                self._rclpy_logger.debug(f"Failed to cancel goal in cancel callback: {error}")
                continue
            response.goals_canceling.append(goal_handle._goal_info)
        self._rclpy_respond(self._rclpy_cancel_service, response, request_id)

    def _rclpy_goals_to_cancel(self, goal_info: GoalInfo) -> tuple[int, list[ServerGoalHandle]]:
        """Return the response's code, and the goals that a request to cancel selects.

        A UUID without a stamp selects this goal. Otherwise, the stamp selects all goals that were accepted
        until then, in addition to the goal with the UUID; without both, all goals are selected.
        """
        goal_uuid, stamp = uuid_bytes(goal_info.goal_id), _nanoseconds(goal_info.stamp)
        with self._rclpy_lock:
            goal_handles = dict(self._goal_handles)
        cancelable = {
            key: goal_handle
            for key, goal_handle in goal_handles.items()
            if goal_handle.status in (_ACCEPTED, _EXECUTING)
        }
        if any(goal_uuid) and not stamp:
            if goal_uuid in cancelable:
                return CancelGoal.Response.ERROR_NONE, [cancelable[goal_uuid]]
            if goal_uuid in goal_handles:
                return CancelGoal.Response.ERROR_GOAL_TERMINATED, []
            return CancelGoal.Response.ERROR_UNKNOWN_GOAL_ID, []
        selected = [
            goal_handle
            for key, goal_handle in cancelable.items()
            if key == goal_uuid or not stamp or _nanoseconds(goal_handle._goal_info.stamp) <= stamp
        ]
        return CancelGoal.Response.ERROR_NONE, selected

    def _rclpy_handle_result_request(self, request: Any, request_id: RequestId) -> None:
        future = self._result_futures.get(uuid_bytes(request.goal_id))
        if future is None:
            response = self._action_type.Impl.GetResultService.Response(status=GoalStatus.STATUS_UNKNOWN)
            self._rclpy_respond(self._rclpy_result_service, response, request_id)
        else:
            future.add_done_callback(partial(self._rclpy_send_result, request_id))

    def _rclpy_send_result(self, request_id: RequestId, future: Future) -> None:
        try:
            self._rclpy_respond(self._rclpy_result_service, future.result(), request_id)
        except (TypeError, ValueError) as error:
            self._rclpy_logger.error(f"The execute callback returned an invalid result: {error}")
            future.result().result = self._action_type.Result()
            self._rclpy_respond(self._rclpy_result_service, future.result(), request_id)

    def _rclpy_respond(self, service: Service, response: Any, request_id: RequestId) -> None:
        try:
            service.send_response(response, request_id)
        except (RCLError, InvalidHandle) as error:
            self._rclpy_logger.warning(f"Failed to send a response on {service.service_name}: {error}")

    # State

    def _rclpy_now(self) -> int:
        return self._node.get_clock().now().nanoseconds

    def _rclpy_publish_status(self) -> None:
        with self._rclpy_lock:
            statuses = [
                GoalStatus(goal_info=goal_handle._goal_info, status=goal_handle._rclpy_state)
                for goal_handle in self._goal_handles.values()
            ]
            self._rclpy_status.publish(GoalStatusArray(status_list=statuses))

    def _rclpy_publish_feedback(self, message: Any) -> None:
        self._rclpy_feedback.publish(message)

    def notify_goal_done(self) -> None:
        """Let the timer forget the goal that has ended when its time has come."""
        with self._rclpy_lock:
            ends = [
                goal_handle._rclpy_ended_at
                for goal_handle in self._goal_handles.values()
                if goal_handle._rclpy_state not in _ACTIVE
            ]
            if not ends:
                self._rclpy_expiry.cancel()
                return
            self._rclpy_expiry.timer_period_ns = max(
                0, min(ends) + self._rclpy_result_timeout - self._rclpy_now()
            )
            self._rclpy_expiry.reset()

    def _rclpy_expire_goals(self) -> None:
        oldest = self._rclpy_now() - self._rclpy_result_timeout
        with self._rclpy_lock:
            expired = {
                goal_uuid: goal_handle
                for goal_uuid, goal_handle in self._goal_handles.items()
                if goal_handle._rclpy_state not in _ACTIVE and goal_handle._rclpy_ended_at <= oldest
            }
            for goal_uuid in expired:
                del self._goal_handles[goal_uuid], self._result_futures[goal_uuid]
            self.notify_goal_done()
        for goal_handle in expired.values():  # without the lock: a goal's own lock comes first
            goal_handle.destroy()

    # Callbacks

    def register_handle_accepted_callback(
        self, handle_accepted_callback: Callable[[ServerGoalHandle], Any] | None
    ) -> None:
        """Replace the callback for accepted goals; ``None``: execute them at once."""
        self._handle_accepted_callback = handle_accepted_callback or default_handle_accepted_callback

    def register_goal_callback(self, goal_callback: Callable[[Any], Any] | None) -> None:
        """Replace the callback that accepts or rejects goals; ``None``: accept all."""
        self._goal_callback = goal_callback or default_goal_callback

    def register_cancel_callback(self, cancel_callback: Callable[[ServerGoalHandle], Any] | None) -> None:
        """Replace the callback that accepts or rejects requests to cancel a goal; ``None``: reject all."""
        self._cancel_callback = cancel_callback or default_cancel_callback

    def register_execute_callback(self, execute_callback: Callable[[ServerGoalHandle], Any]) -> None:
        """Replace the callback that executes goals. Raises TypeError if it is not callable."""
        if not callable(execute_callback):
            raise TypeError("Failed to register goal execution callback: not callable")
        self._execute_callback = execute_callback

    # Receiving

    def get_num_entities(self) -> NumberOfEntities:
        """Return the numbers of timers and services."""
        return NumberOfEntities(num_timers=1, num_services=3)

    def take_data(self) -> dict[str, Any]:
        """Take what has arrived: at most one request of each service."""
        sources = {
            "goal": self._rclpy_goal_service,
            "cancel": self._rclpy_cancel_service,
            "result": self._rclpy_result_service,
        }
        taken = ((name, source._rclpy_take()) for name, source in sources.items())
        return {name: data for name, data in taken if data is not None}

    async def execute(self, taken_data: dict[str, Any]) -> None:
        """Handle the requests, with the callbacks of the server."""
        if "goal" in taken_data:
            await self._rclpy_handle_goal_request(*taken_data["goal"])
        if "cancel" in taken_data:
            await self._rclpy_handle_cancel_request(*taken_data["cancel"])
        if "result" in taken_data:
            self._rclpy_handle_result_request(*taken_data["result"])

    def _rclpy_close(self) -> None:
        for task in list(self._rclpy_executions):
            task._rclpy_cancel_before_start()
        for goal_handle in list(self._goal_handles.values()):
            goal_handle.destroy()
        self._rclpy_expiry.destroy()
        super()._rclpy_close()


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * S_TO_NS + int(stamp.nanosec)
