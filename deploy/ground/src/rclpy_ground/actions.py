"""Action clients and servers: three services and two topics each."""

from __future__ import annotations

from typing import Any

from rclpy_ground.clocks import Clock
from rclpy_ground.genuine import RCLError
from rclpy_ground.goals import ActionGoalHandle
from rclpy_ground.handles import Destroyable
from rclpy_ground.nodes import Node
from rclpy_ground.services import Client, Service
from rclpy_ground.timers import Timer
from rclpy_ground.topics import Publisher, Subscription, is_full_name

_UNKNOWN_GOAL_ID, _GOAL_TERMINATED = 2, 3  # action_msgs/srv/CancelGoal


def _path(node: Node, name: str, side: str) -> str:
    """Return what the names of its services and topics begin with."""
    try:
        full = node.expand(name)
    except ValueError:
        full = ""
    if not is_full_name(full):
        raise ValueError(f"Failed to create action {side} due to invalid topic name '{name}'")
    return f"{full}/_action/"


class _Side(Destroyable):
    parts: tuple[Destroyable, ...]
    """Its endpoints and timers."""

    def get_num_entities(self) -> tuple[int, int, int, int, int]:
        """Return the numbers of subscriptions, guard conditions, timers, clients and services."""

        def count(kind: type) -> int:
            return sum(isinstance(each, kind) for each in self.parts)

        return count(Subscription), 0, count(Timer), count(Client), count(Service)

    def add_to_waitset(self, wait_set: Any) -> None:
        adders = {
            Subscription: ("subscription", wait_set.add_subscription),
            Timer: ("timer", wait_set.add_timer),
            Client: ("client", wait_set.add_client),
            Service: ("service", wait_set.add_service),
        }
        self._places = [
            (adders[type(each)][0], adders[type(each)][1](each))
            for each in self.parts
            if type(each) in adders
        ]

    def is_ready(self, wait_set: Any) -> tuple[bool, ...]:
        return tuple(wait_set.is_ready(kind, index) for kind, index in self._places)

    def configure_introspection(self, clock: Clock, qos: Any, state: Any) -> None:
        """Publish the events of its services, or no longer."""
        for part in self.parts:
            if isinstance(part, (Client, Service)):
                part.configure_introspection(clock, qos, state)

    def destroy(self) -> None:
        for part in self.parts:
            part.destroy_when_not_in_use()


class ActionClient(_Side):
    def __init__(self, node: Node, action: Any, name: str, *profiles: Any, **options: Any) -> None:
        from action_msgs.msg import GoalStatusArray
        from action_msgs.srv import CancelGoal

        goal, result, cancel, feedback, status = profiles[:5]
        path = _path(node, name, "client")
        impl = action.Impl
        self._goal = Client(node, impl.SendGoalService, path + "send_goal", goal)
        self._cancel = Client(node, CancelGoal, path + "cancel_goal", cancel)
        self._result = Client(node, impl.GetResultService, path + "get_result", result)
        self._feedback = Subscription(node, impl.FeedbackMessage, path + "feedback", feedback)
        self._status = Subscription(node, GoalStatusArray, path + "status", status)
        self.parts = self._feedback, self._status, self._goal, self._cancel, self._result
        node.note_type(action, "action")
        super().__init__()

    def is_action_server_available(self) -> bool:
        services = (self._goal, self._cancel, self._result)
        topics = (self._feedback, self._status)
        return all(each.service_server_is_available() for each in services) and all(
            each.get_publisher_count() for each in topics
        )

    def send_goal_request(self, request: Any) -> int:
        return self._goal.send_request(request)

    def send_cancel_request(self, request: Any) -> int:
        return self._cancel.send_request(request)

    def send_result_request(self, request: Any) -> int:
        return self._result.send_request(request)

    def take_goal_response(self, message: Any) -> tuple[int | None, Any]:
        return _response(self._goal, message)

    def take_cancel_response(self, message: Any) -> tuple[int | None, Any]:
        return _response(self._cancel, message)

    def take_result_response(self, message: Any) -> tuple[int | None, Any]:
        return _response(self._result, message)

    def take_feedback(self, message: Any) -> Any:
        return _message(self._feedback, message)

    def take_status(self, message: Any) -> Any:
        return _message(self._status, message)


def _response(client: Client, message: Any) -> tuple[int | None, Any]:
    header, response = client.take_response(message)
    return (None, None) if header is None else (header.request_id.sequence_number, response)


def _message(subscription: Subscription, message: Any) -> Any:
    taken = subscription.take_message(message, False)
    return taken and taken[0]


def _request(service: Service, message: Any) -> tuple[Any, Any]:
    request, header = service.service_take_request(message)
    return (None, None) if header is None else (header.request_id, request)


class ActionServer(_Side):
    def __init__(self, node: Node, clock: Clock, action: Any, name: str, *profiles: Any) -> None:
        from action_msgs.msg import GoalStatusArray
        from action_msgs.srv import CancelGoal

        goal, result, cancel, feedback, status, timeout = profiles
        if timeout < 0:
            raise ValueError(f"Failed to create action server: a result timeout of {timeout} s")
        path = _path(node, name, "server")
        impl = action.Impl
        self._clock, self._timeout = clock, int(timeout * 1e9)
        self._goals: dict[bytes, ActionGoalHandle] = {}
        self._goal = Service(node, impl.SendGoalService, path + "send_goal", goal)
        self._cancel = Service(node, CancelGoal, path + "cancel_goal", cancel)
        self._result = Service(node, impl.GetResultService, path + "get_result", result)
        self._expiry = Timer(clock, node.context, 0, autostart=False)
        self._feedback = Publisher(node, impl.FeedbackMessage, path + "feedback", feedback)
        self._status = Publisher(node, GoalStatusArray, path + "status", status)
        self.parts = self._goal, self._cancel, self._result, self._expiry, self._feedback, self._status
        node.note_type(action, "action")
        super().__init__()

    def now(self) -> int:
        """Return the time of its clock [ns]."""
        return self._clock.nanoseconds()

    def take_goal_request(self, message: Any) -> tuple[Any, Any]:
        return _request(self._goal, message)

    def take_cancel_request(self, message: Any) -> tuple[Any, Any]:
        return _request(self._cancel, message)

    def take_result_request(self, message: Any) -> tuple[Any, Any]:
        return _request(self._result, message)

    def send_goal_response(self, header: Any, response: Any) -> None:
        self._goal.service_send_response(response, header)

    def send_cancel_response(self, header: Any, response: Any) -> None:
        self._cancel.service_send_response(response, header)

    def send_result_response(self, header: Any, response: Any) -> None:
        self._result.service_send_response(response, header)

    def publish_feedback(self, message: Any) -> None:
        self._feedback.publish(message)

    def publish_status(self) -> None:
        from action_msgs.msg import GoalStatus, GoalStatusArray

        statuses = [GoalStatus(goal_info=each.info, status=each.status) for each in self._goals.values()]
        self._status.publish(GoalStatusArray(status_list=statuses))

    def goal_exists(self, info: Any) -> bool:
        return bytes(info.goal_id.uuid) in self._goals

    def accept(self, handle: ActionGoalHandle) -> None:
        if handle.key in self._goals:
            raise RCLError("Failed to accept new goal: goal ID already exists")
        self._goals[handle.key] = handle

    def process_cancel_request(self, request: Any, response_type: Any) -> Any:
        """Return the answer to a request: the goal of an id, those accepted until a time, or all."""
        wanted = request.goal_info
        key = bytes(wanted.goal_id.uuid)
        stamp = wanted.stamp.sec * 10**9 + wanted.stamp.nanosec
        is_one = any(key) and not stamp
        response = response_type()
        if is_one and key not in self._goals:
            response.return_code = _UNKNOWN_GOAL_ID
            return response
        chosen = [
            each
            for each in self._goals.values()
            if each.key == key or (not is_one and (not stamp or each.accepted <= stamp))
        ]
        cancelable = [each for each in chosen if each.is_cancelable()]
        if is_one and not cancelable:
            response.return_code = _GOAL_TERMINATED
        response.goals_canceling = [each.info for each in cancelable]
        return response

    def notify_goal_done(self) -> None:
        self._schedule()

    def _schedule(self) -> None:
        """Set the timer for the next goal that is to be forgotten."""
        ends = [each.ended + self._timeout for each in self._goals.values() if each.ended is not None]
        self._expiry.cancel_timer()
        if ends and self._timeout >= 0:
            self._expiry.change_timer_period(max(0, min(ends) - self.now()))
            self._expiry.reset_timer()

    def expire_goals(self, most: int) -> tuple[Any, ...]:
        """Forget at most so many goals that have ended long ago; return which."""
        now = self.now()
        expired = [
            each
            for each in self._goals.values()
            if each.ended is not None and now >= each.ended + self._timeout
        ][:most]
        for each in expired:
            del self._goals[each.key]
        self._schedule()
        return tuple(each.info for each in expired)
