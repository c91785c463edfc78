"""The topics and services of an action (design.ros2.org, "Actions")."""

from __future__ import annotations

from collections.abc import Coroutine, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.exceptions import NameValidationException
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.type_support import check_for_type_support
from rclpy.waitable import Waitable

if TYPE_CHECKING:
    from rclpy.node import Node


class Endpoints:
    """Creates the endpoints of an action client or server, which the node does not list."""

    def __init__(self, node: Node, action_name: str, group: CallbackGroup) -> None:
        self._node = node
        self._prefix = f"{action_name}/_action/"
        self._group = group
        self.created: list[Publisher | Subscription | Client | Service] = []

    def client(self, srv_type: Any, name: str, profile: QoSProfile, kind: type[Client] = Client) -> Client:
        name = self._prefix + name
        endpoint = self._node._rclpy_service_endpoint(srv_type, name, profile, is_server=False)
        client = kind(self._node.context, endpoint, srv_type, name, profile, self._group)
        self.created.append(client)
        return client

    def service(self, srv_type: Any, name: str, profile: QoSProfile) -> Service:
        name = self._prefix + name
        endpoint = self._node._rclpy_service_endpoint(srv_type, name, profile, is_server=True)
        service = Service(endpoint, srv_type, name, _never_called, self._group, profile)
        self.created.append(service)
        return service

    def subscription(self, msg_type: Any, name: str, profile: QoSProfile) -> Subscription:
        silent = SubscriptionEventCallbacks(use_default_callbacks=False)
        subscription = self._node._rclpy_make_subscription(
            msg_type, self._prefix + name, _never_called, profile, self._group, silent
        )
        self.created.append(subscription)
        return subscription

    def publisher(self, msg_type: Any, name: str, profile: QoSProfile) -> Publisher:
        publisher = self._node._rclpy_create_own_publisher(msg_type, self._prefix + name, profile)
        self.created.append(publisher)
        return publisher

    def handles(self) -> tuple[int, ...]:
        return tuple(
            handle for endpoint in self.created for handle in getattr(endpoint, "_rclpy_handles", ())
        )

    def destroy(self) -> None:
        with self._node._rclpy_graph.one_announcement():
            for endpoint in self.created:
                endpoint.destroy()


def _never_called(message: Any, response: Any = None) -> None:
    """Stand in for a callback: the action client or server takes the messages itself."""


@contextmanager
def creation(
    node: Node, kind: str, action_type: Any, action_name: str, group: CallbackGroup
) -> Iterator[Endpoints]:
    """Announce all endpoints that the block creates together; if it fails, destroy them.

    :param kind: the subject of error messages.
    :raises AttributeError: if ``action_type`` is not the type of an action.
    :raises ValueError: if the action's name is invalid.
    """
    check_for_type_support(action_type)
    if not hasattr(action_type, "Impl"):
        raise AttributeError(f"{action_type!r} is not a ROS 2 action type")
    if not action_name:
        raise ValueError(f"Failed to create {kind}: the name of the action is empty")
    endpoints = Endpoints(node, action_name, group)
    with node._rclpy_graph.one_announcement():
        try:
            yield endpoints
        except BaseException as error:
            endpoints.destroy()
            if isinstance(error, NameValidationException):
                text = f"Failed to create {kind} due to invalid topic name '{action_name}' : {error}"
                raise ValueError(text) from error
            raise
    node._rclpy_used_types.add(action_type)


def uuid_bytes(goal_id: Any) -> bytes:
    """Return the 16 bytes of a ``unique_identifier_msgs/msg/UUID``, read without importing NumPy."""
    data: bytes = goal_id._uuid_.tobytes()
    return data


class ActionWaitable(Waitable):
    """What an action client and an action server have in common for executors."""

    _node: Node
    _rclpy_endpoints: Endpoints
    _rclpy_in_wait_set: list[tuple[str, int]]

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Add what receives messages to a wait set; the node's executor does without."""
        kinds = {Subscription: "subscription", Service: "service"}
        self._rclpy_in_wait_set = [
            (kind, wait_set._add(kind, handle))
            for endpoint in self._rclpy_endpoints.created
            for kind in (kinds.get(type(endpoint), "client"),)
            for handle in getattr(endpoint, "_rclpy_handles", ())
        ]

    def is_ready(self, wait_set: Any) -> bool:
        return any(wait_set.is_ready(kind, index) for kind, index in self._rclpy_in_wait_set)

    def _rclpy_take(self) -> dict[str, Any] | None:
        return self.take_data() or None

    def _rclpy_execute(self, taken: dict[str, Any]) -> Coroutine[Any, Any, None]:
        return self.execute(taken)

    def destroy(self) -> None:
        """Destroy it: it receives nothing any more, and a server forgets its goals."""
        if self in self._node.waitables:
            self._node.remove_waitable(self)
        self._rclpy_close()

    def _rclpy_close(self) -> None:
        self._rclpy_endpoints.destroy()
