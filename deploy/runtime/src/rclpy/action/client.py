"""Action clients: they send goals, receive feedback and results, and cancel goals."""

from __future__ import annotations

import threading
import uuid
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from rclpy.action._endpoints import ActionWaitable, creation, uuid_bytes
from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client
from rclpy.executors import await_or_execute
from rclpy.qos import QoSProfile, qos_profile_action_status_default, qos_profile_services_default
from rclpy.task import Future
from rclpy.waitable import NumberOfEntities
from unique_identifier_msgs.msg import UUID

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.timer import Timer

_TERMINAL = (GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_CANCELED, GoalStatus.STATUS_ABORTED)


class ClientGoalHandle:
    """A goal that was sent, as the result of :meth:`ActionClient.send_goal_async`."""

    def __init__(self, action_client: ActionClient, goal_id: UUID, goal_response: Any) -> None:
        self._action_client = action_client
        self._goal_id = goal_id
        self._goal_response = goal_response
        self._status: int = GoalStatus.STATUS_UNKNOWN

    def __eq__(self, other: object) -> bool:
        return isinstance(other, ClientGoalHandle) and self._goal_id == other.goal_id

    def __ne__(self, other: object) -> bool:
        return not self == other

    def __repr__(self) -> str:
        return f"ClientGoalHandle <id={self.goal_id.uuid}, accepted={self.accepted}, status={self.status}>"

    @property
    def goal_id(self) -> UUID:
        return self._goal_id

    @property
    def stamp(self) -> Any:
        """The time at which the server accepted the goal (``builtin_interfaces/msg/Time``)."""
        return self._goal_response.stamp

    @property
    def accepted(self) -> bool:
        return bool(self._goal_response.accepted)

    @property
    def status(self) -> int:
        """The last status that the server published, a constant of ``action_msgs/msg/GoalStatus``."""
        return self._status

    def cancel_goal(self) -> Any:
        """Wait for the ``action_msgs/srv/CancelGoal`` response; not in a callback, see `get_result`."""
        return self._action_client._cancel_goal(self)

    def cancel_goal_async(self) -> Future:
        """Ask the server to cancel the goal; the future gets its ``action_msgs/srv/CancelGoal`` response."""
        return self._action_client._cancel_goal_async(self)

    def get_result(self) -> Any:
        """Wait for ``status`` and ``result``; not in a callback: another thread must spin the node."""
        return self._action_client._get_result(self)

    def get_result_async(self) -> Future:
        """Ask for the result; the future gets the response with ``status`` and ``result`` of the goal."""
        return self._action_client._get_result_async(self)


class _Calls(Client):
    kind = ""

    def _rclpy_ignore_reply(self) -> None:
        self._rclpy_node.get_logger().get_child("action_client").warning(
            f"Ignoring unexpected {self.kind} response. There may be more than one action server for the"
            f" action '{self._rclpy_name.partition('/_action/')[0]}'"
        )


class _GoalCalls(_Calls):
    kind = "goal"


class _CancelCalls(_Calls):
    kind = "cancel"


class _ResultCalls(_Calls):
    kind = "result"


class ActionClient(ActionWaitable):
    def __init__(
        self,
        node: Node,
        action_type: Any,
        action_name: str,
        *,
        callback_group: CallbackGroup | None = None,
        goal_service_qos_profile: QoSProfile = qos_profile_services_default,
        result_service_qos_profile: QoSProfile = qos_profile_services_default,
        cancel_service_qos_profile: QoSProfile = qos_profile_services_default,
        feedback_sub_qos_profile: QoSProfile = QoSProfile(depth=10),  # noqa: B008
        status_sub_qos_profile: QoSProfile = qos_profile_action_status_default,
    ) -> None:
        """Create an action client.

        :param node: the node, whose executor runs the callbacks.
        :param action_type: the type of the action.
        :param action_name: its name, with which the names of its topics and services begin.
        :param callback_group: the group of the callbacks; the node's default group if ``None``.
        :raises ValueError: if the name is invalid.
        """
        group = callback_group or node.default_callback_group
        super().__init__(group)
        self._node = node
        self._action_type = action_type
        self._action_name = action_name
        self._rclpy_lock = threading.Lock()
        self._rclpy_goal_ids: dict[Future, UUID] = {}  # of the goals that the server has not answered yet
        self._goal_handles: dict[bytes, weakref.ref[ClientGoalHandle]] = {}
        self._feedback_callbacks: dict[bytes, Callable[[Any], Any]] = {}
        self._rclpy_last_statuses: dict[bytes, int] = {}
        with creation(node, "action client", action_type, action_name, group) as endpoints:
            impl = action_type.Impl
            self._rclpy_goal_calls = endpoints.client(
                impl.SendGoalService, "send_goal", goal_service_qos_profile, _GoalCalls
            )
            self._rclpy_cancel_calls = endpoints.client(
                impl.CancelGoalService, "cancel_goal", cancel_service_qos_profile, _CancelCalls
            )
            self._rclpy_result_calls = endpoints.client(
                impl.GetResultService, "get_result", result_service_qos_profile, _ResultCalls
            )
            self._rclpy_feedback = endpoints.subscription(
                impl.FeedbackMessage, "feedback", feedback_sub_qos_profile
            )
            self._rclpy_status = endpoints.subscription(
                impl.GoalStatusMessage, "status", status_sub_qos_profile
            )
        self._rclpy_endpoints = endpoints
        # The interface that executors use for every entity.
        self._rclpy_handles = endpoints.handles()
        self._rclpy_timers: tuple[Timer, ...] = ()
        node.add_waitable(self)

    # Sending

    def send_goal(self, goal: Any, **kwargs: Any) -> Any:
        """Send a goal and wait for its result as :meth:`ClientGoalHandle.get_result` does."""
        goal_handle = self._rclpy_wait_for(self.send_goal_async(goal, **kwargs))
        return None if goal_handle is None else self._get_result(goal_handle)

    def send_goal_async(
        self,
        goal: Any,
        feedback_callback: Callable[[Any], Any] | None = None,
        goal_uuid: UUID | None = None,
    ) -> Future:
        """Send a goal; the future gets a :class:`ClientGoalHandle` when the server accepts or rejects it.

        :param feedback_callback: called with each feedback message: ``goal_id`` and ``feedback``.
        :param goal_uuid: the UUID of the goal; random if ``None``.
        :raises TypeError: if ``goal`` is not of the action's goal type.
        """
        if not isinstance(goal, self._action_type.Goal):
            raise TypeError(f"Expected {self._action_type.Goal._TYPE_NAME}, got {goal!r}")
        goal_id = UUID(uuid=uuid.uuid4().bytes) if goal_uuid is None else goal_uuid
        request = self._action_type.Impl.SendGoalService.Request(goal_id=goal_id, goal=goal)
        if feedback_callback is not None:  # before the request: the server may be quick
            self._feedback_callbacks[uuid_bytes(goal_id)] = feedback_callback
        with self._rclpy_lock:  # until the goal is registered, no other thread may handle the response
            future = self._rclpy_goal_calls.call_async(request)
            self._rclpy_goal_ids[future] = goal_id
        future._rclpy_call_when_complete(lambda: self._rclpy_forget_request(future))
        return future

    def _rclpy_forget_request(self, future: Future) -> None:
        """Forget the UUID of a goal that was answered or cancelled, and the callback of a rejected goal."""
        with self._rclpy_lock:
            goal_id = self._rclpy_goal_ids.pop(future, None)
        if goal_id is not None and (future.cancelled() or not future.result().accepted):
            self._rclpy_forget_callback(uuid_bytes(goal_id))

    def _cancel_goal(self, goal_handle: ClientGoalHandle) -> Any:
        return self._rclpy_wait_for(self._cancel_goal_async(goal_handle))

    def _cancel_goal_async(self, goal_handle: ClientGoalHandle) -> Future:
        _check_goal_handle(goal_handle)
        request = CancelGoal.Request()
        request.goal_info.goal_id = goal_handle.goal_id
        return self._rclpy_cancel_calls.call_async(request)

    def _get_result(self, goal_handle: ClientGoalHandle) -> Any:
        return self._rclpy_wait_for(self._get_result_async(goal_handle))

    def _get_result_async(self, goal_handle: ClientGoalHandle) -> Future:
        _check_goal_handle(goal_handle)
        request = self._action_type.Impl.GetResultService.Request(goal_id=goal_handle.goal_id)
        future = self._rclpy_result_calls.call_async(request)
        goal_uuid = uuid_bytes(goal_handle.goal_id)
        future._rclpy_call_when_complete(lambda: self._rclpy_forget_callback(goal_uuid))
        return future

    def _rclpy_forget_callback(self, goal_uuid: bytes) -> None:
        self._feedback_callbacks.pop(goal_uuid, None)

    def _rclpy_wait_for(self, future: Future) -> Any:
        """Wait for the result; return ``None`` if the context is shut down."""
        event = threading.Event()
        future._rclpy_call_when_complete(event.set)
        self._node.context._rclpy_wake_on_shutdown(event)
        event.wait()
        return future.result()

    # The server

    def server_is_ready(self) -> bool:
        """Whether there is a server that receives goals and whose feedback and status arrive."""
        calls = (self._rclpy_goal_calls, self._rclpy_cancel_calls, self._rclpy_result_calls)
        topics = (self._rclpy_feedback, self._rclpy_status)
        return all(call.service_is_ready() for call in calls) and all(
            topic.get_publisher_count() > 0 for topic in topics
        )

    def wait_for_server(self, timeout_sec: float | None = None) -> bool:
        """Return whether a server comes within ``timeout_sec`` (``None``: no limit). RCLError at shutdown."""
        timeout = None if timeout_sec is None else max(0.0, timeout_sec)
        graph, context = self._node._rclpy_graph, self._node.context
        return graph.wait_for(self.server_is_ready, timeout, context.ok) or self.server_is_ready()

    # Receiving

    def get_num_entities(self) -> NumberOfEntities:
        """Return the numbers of subscriptions and clients."""
        return NumberOfEntities(num_subs=2, num_clients=3)

    def take_data(self) -> dict[str, Any]:
        """Take what has arrived: a response of each service, a status message and feedback messages."""
        feedback: list[Any] = []
        taken = {
            "goal": self._rclpy_goal_calls._rclpy_take(),
            "cancel": self._rclpy_cancel_calls._rclpy_take(),
            "result": self._rclpy_result_calls._rclpy_take(),
            "feedback": feedback,
            "status": self._rclpy_status._rclpy_take(),
        }
        # With the result, the goal's callback is forgotten: first call it with all feedback that has arrived.
        while (message := self._rclpy_feedback._rclpy_take()) is not None:
            feedback += message
            if taken["result"] is None:
                break
        return {name: data for name, data in taken.items() if data}

    async def execute(self, taken_data: dict[str, Any]) -> None:
        """Complete the futures of the responses, call back with the feedback, and update the goal handles."""
        if "goal" in taken_data:
            self._rclpy_handle_goal_response(*taken_data["goal"])
        if "cancel" in taken_data:
            self._rclpy_cancel_calls._rclpy_execute(taken_data["cancel"])
        for feedback in taken_data.get("feedback", ()):
            callback = self._feedback_callbacks.get(uuid_bytes(feedback.goal_id))
            if callback is not None:
                await await_or_execute(callback, feedback)
        if "result" in taken_data:
            self._rclpy_result_calls._rclpy_execute(taken_data["result"])
        if "status" in taken_data:
            self._rclpy_handle_statuses(*taken_data["status"])

    def _rclpy_handle_goal_response(self, future: Future, response: Any) -> None:
        with self._rclpy_lock:
            goal_id = self._rclpy_goal_ids.get(future)
        if goal_id is None:  # the future was just cancelled
            return
        goal_handle = ClientGoalHandle(self, goal_id, response)
        if goal_handle.accepted:
            goal_uuid = uuid_bytes(goal_id)
            with self._rclpy_lock:
                if goal_uuid in self._goal_handles:
                    raise RuntimeError(f"Two goals were accepted with the same ID ({goal_handle})")
                self._goal_handles[goal_uuid] = weakref.ref(goal_handle)
                # The topic may be quicker than the service.
                self._rclpy_update_status(goal_uuid, self._rclpy_last_statuses.get(goal_uuid))
        self._rclpy_goal_calls._rclpy_execute((future, goal_handle))

    def _rclpy_handle_statuses(self, message: Any) -> None:
        with self._rclpy_lock:
            self._rclpy_last_statuses = {
                uuid_bytes(status.goal_info.goal_id): status.status for status in message.status_list
            }
            for goal_uuid in list(self._goal_handles):
                self._rclpy_update_status(goal_uuid, self._rclpy_last_statuses.get(goal_uuid))

    def _rclpy_update_status(self, goal_uuid: bytes, status: int | None) -> None:
        """Update a goal handle; forget it if it will not change any more. The caller holds the lock."""
        goal_handle = self._goal_handles[goal_uuid]()
        if goal_handle is not None and status is not None:
            goal_handle._status = status
        if goal_handle is None or status in _TERMINAL:
            del self._goal_handles[goal_uuid]


def _check_goal_handle(goal_handle: Any) -> None:
    if not isinstance(goal_handle, ClientGoalHandle):
        raise TypeError(f"Expected type ClientGoalHandle but received {type(goal_handle)}")
