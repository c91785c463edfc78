"""What others send to rclpy itself, and what they call themselves, ends no node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service import Service
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

_REPORTED_EVERY = 1.0  # s


class Endpoint(NamedTuple):
    """A publisher or subscriber of a topic, as the graph knows it."""

    node: str
    """The name of its node; what is not UTF-8, or not printable, is replaced."""
    namespace: str
    """Empty if it is not known."""
    type: str
    """Empty if it is not known."""
    gid: tuple[int, ...]
    """Empty if it is not known."""
    qos: QoSProfile | None = None


class TolerantNode(Node):
    """A node that survives strangers.

    rclpy answers the requests for parameters and follows ``/clock`` by callbacks of its own, which raise at
    some content, such as a parameter of an unknown type or a negative time. That would end the spinning.
    """

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[..., Any], *args: Any, **options: Any
    ) -> Subscription:
        """Create a subscription; see :meth:`rclpy.node.Node.create_subscription`."""

        def survive(message: Any) -> None:
            try:
                callback(message)
            except Exception as error:  # whatever rclpy does not expect
                self.drop(topic, error)

        chosen = survive if _is_of_rclpy(callback) else callback
        return super().create_subscription(msg_type, topic, chosen, *args, **options)

    def create_service(
        self, srv_type: Any, srv_name: str, callback: Callable[..., Any], *args: Any, **options: Any
    ) -> Service:
        """Create a service; see :meth:`rclpy.node.Node.create_service`."""

        def survive(request: Any, response: Any) -> Any:
            try:
                return callback(request, response)
            except Exception as error:  # whatever rclpy does not expect
                self.drop(srv_name, error)
                return response

        chosen = survive if _is_of_rclpy(callback) else callback
        return super().create_service(srv_type, srv_name, chosen, *args, **options)

    def drop(self, name: str, error: Exception) -> None:
        """Report a message or request that was dropped, by the name of its topic or service."""
        self.get_logger().warning(f"dropped from {name}: {error}", throttle_duration_sec=_REPORTED_EVERY)

    def publishers_of(self, topic: str) -> list[Endpoint]:
        """Return the publishers of a topic.

        rclpy of ROS 2 shows none of the others while one has a node whose name is not UTF-8: then the list
        has only that one, and nothing but its name.
        """
        return _endpoints(self.get_publishers_info_by_topic, topic)

    def subscribers_of(self, topic: str) -> list[Endpoint]:
        """Return the subscribers of a topic; see :meth:`publishers_of`."""
        return _endpoints(self.get_subscriptions_info_by_topic, topic)

    def topic_types(self) -> dict[str, list[str]]:
        """Return the types of each topic by its name; none while a name is not UTF-8."""
        try:
            return dict(self.get_topic_names_and_types())
        except UnicodeDecodeError:
            return {}

    def service_types(self) -> dict[str, list[str]]:
        """Return the types of each service by its name; none while a name is not UTF-8."""
        try:
            return dict(self.get_service_names_and_types())
        except UnicodeDecodeError:
            return {}


def _endpoints(ask: Callable[[str], list[TopicEndpointInfo]], topic: str) -> list[Endpoint]:
    try:
        found = ask(topic)
    except UnicodeDecodeError as error:
        return [Endpoint(_printable(error.object.decode(errors="replace")), "", "", ())]
    return [
        Endpoint(
            _printable(it.node_name),
            _printable(it.node_namespace),
            it.topic_type,
            tuple(it.endpoint_gid),
            it.qos_profile,
        )
        for it in found
    ]


def _printable(name: str) -> str:
    return "".join(each if each.isprintable() else "\ufffd" for each in name) or "\ufffd"


def _is_of_rclpy(callback: Any) -> bool:
    return str(getattr(callback, "__module__", "")).startswith("rclpy.")
