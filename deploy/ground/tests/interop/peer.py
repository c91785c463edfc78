"""A node that a test commands by lines of JSON. It is plain rclpy, so it runs on any.

`peer.py NAME NAMESPACE` reads [NUMBER, METHOD, ARGUMENTS] and answers [NUMBER, RESULT, ERROR], for a method
of :class:`Peer`. Messages travel as the Python text that makes them. The peer ends at the end of its input.
"""

from __future__ import annotations

import importlib
import inspect
import json
import math
import sys
import threading
import traceback
from collections.abc import Callable
from typing import Any

import rclpy
from rclpy.action import ActionClient, ActionServer, get_action_names_and_types
from rclpy.action.server import ServerGoalHandle
from rclpy.client import Client
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks, SubscriptionEventCallbacks
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from rclpy.task import Future
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_srvs.srv import SetBool

try:
    from example_interfaces.action import Fibonacci
except ModuleNotFoundError:  # ROS 2's wheels
    from test_msgs.action import Fibonacci

PACKAGES = ("builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "sensor_msgs", "std_msgs")
NAMES: dict[str, Any] = {"inf": math.inf, "nan": math.nan}
for package in PACKAGES:
    importlib.import_module(f"{package}.msg")
    NAMES[package] = importlib.import_module(package)


class Peer:
    """A node with publishers, subscriptions and a service; its methods are the commands."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Publisher] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._received: dict[str, list[str]] = {}
        self._clients: dict[str, Client] = {}
        self._calls: list[bool] = []
        self._incompatible: dict[str, list[str]] = {}

    def advertise(self, topic: str, type_name: str, qos: dict[str, Any]) -> None:
        events = PublisherEventCallbacks(incompatible_qos=self._note_incompatible(topic))
        self._publishers[topic] = self._node.create_publisher(
            _type(type_name), topic, _profile(**qos), event_callbacks=events
        )

    def publish(self, topic: str, *messages: str) -> None:
        for text in messages:
            self._publishers[topic].publish(_message(text))

    def subscribe(self, topic: str, type_name: str, qos: dict[str, Any]) -> None:
        received = self._received.setdefault(topic, [])
        self._subscriptions[topic] = self._node.create_subscription(
            _type(type_name),
            topic,
            lambda message: received.append(repr(message)),
            _profile(**qos),
            event_callbacks=SubscriptionEventCallbacks(incompatible_qos=self._note_incompatible(topic)),
        )

    def _note_incompatible(self, topic: str) -> Callable[[Any], None]:
        policies = self._incompatible.setdefault(topic, [])
        return lambda event: policies.append(QoSPolicyKind(event.last_policy_kind).name)

    def incompatible(self, topic: str) -> list[str]:
        """Return the policies that kept an endpoint of the topic from matching another."""
        return self._incompatible[topic]

    def received(self, topic: str) -> list[str]:
        return self._received[topic]

    def readers(self, topic: str) -> int:
        return self._publishers[topic].get_subscription_count()

    def writers(self, topic: str) -> int:
        return self._subscriptions[topic].get_publisher_count()

    def nodes(self) -> list[str]:
        found = self._node.get_node_names_and_namespaces()
        return sorted(f"{namespace.rstrip('/')}/{name}" for name, namespace in found)

    def graph(self) -> dict[str, Any]:
        return {
            "topics": dict(self._node.get_topic_names_and_types()),
            "services": dict(self._node.get_service_names_and_types()),
        }

    def interface(self, name: str, namespace: str) -> dict[str, Any]:
        """Return the types of what a node publishes, subscribes to, serves and calls."""
        return {
            "publishers": dict(self._node.get_publisher_names_and_types_by_node(name, namespace)),
            "subscriptions": dict(self._node.get_subscriber_names_and_types_by_node(name, namespace)),
            "services": dict(self._node.get_service_names_and_types_by_node(name, namespace)),
            "clients": dict(self._node.get_client_names_and_types_by_node(name, namespace)),
        }

    def endpoints(self, topic: str) -> list[dict[str, Any]]:
        """Return what is known of the publishers and subscriptions of a topic."""
        publishers = self._node.get_publishers_info_by_topic(topic)
        return [_endpoint(info) for info in (*publishers, *self._node.get_subscriptions_info_by_topic(topic))]

    def serve(self, service: str) -> None:
        """Create a service (SetBool) that answers with what it is asked for."""

        def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
            self._calls.append(request.data)
            response.success, response.message = request.data, self._node.get_name()
            return response

        self._node.create_service(SetBool, service, answer)

    def calls(self) -> list[bool]:
        return self._calls

    def find(self, service: str) -> bool:
        """Create the client of a service (SetBool) on first use; return whether it has found a server."""
        if service not in self._clients:
            self._clients[service] = self._node.create_client(SetBool, service)
        return self._clients[service].service_is_ready()

    async def call(self, service: str, data: bool) -> str:
        """Call a service; return its response."""
        return repr(await self._clients[service].call_async(SetBool.Request(data=data)))

    def actions(self) -> dict[str, list[str]]:
        return dict(get_action_names_and_types(self._node))

    def serve_action(self, action: str) -> None:
        """Serve an action (Fibonacci); the result has the order of the goal."""

        def execute(goal_handle: ServerGoalHandle) -> Any:
            goal_handle.succeed()
            return Fibonacci.Result(sequence=[goal_handle.request.order])

        ActionServer(self._node, Fibonacci, action, execute)

    async def reach(self, action: str, order: int) -> list[int]:
        """Send a goal to an action (Fibonacci); return its result."""
        client = ActionClient(self._node, Fibonacci, action)
        client.wait_for_server(timeout_sec=10.0)
        goal_handle = await client.send_goal_async(Fibonacci.Goal(order=order))
        return list((await goal_handle.get_result_async()).result.sequence)

    def declare(self, parameter: str, value: Any) -> None:
        self._node.declare_parameter(parameter, value)

    async def set(self, node: str, name: str, value: Any) -> dict[str, Any]:
        """Set a parameter of another node; return what lists and descriptions say of it, and its value."""
        client = AsyncParameterClient(self._node, node)
        client.wait_for_services(timeout_sec=10.0)
        done = await client.set_parameters([Parameter(name, value=value)])
        listed = await client.list_parameters([name], 1)
        described = await client.describe_parameters([name])
        got = await client.get_parameters([name])
        return {
            "successful": done.results[0].successful,
            "names": list(listed.result.names),
            "description": [described.descriptors[0].name, described.descriptors[0].type],
            "value": got.values[0].double_value,
        }


def _type(name: str) -> Any:
    package, kind, type_name = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), type_name)


def _message(text: str) -> Any:
    return eval(text, NAMES)


def _profile(
    depth: int, reliability: str = "RELIABLE", durability: str = "VOLATILE", lifespan: float = 0.0
) -> QoSProfile:
    """Return a QoS profile; 0 s is an infinite lifespan."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy[reliability],
        durability=DurabilityPolicy[durability],
        lifespan=Duration(seconds=lifespan),
    )


def _endpoint(info: TopicEndpointInfo) -> dict[str, Any]:
    qos = info.qos_profile
    return {
        "kind": info.endpoint_type.name,
        "node": f"{info.node_namespace.rstrip('/')}/{info.node_name}",
        "type": info.topic_type,
        "hash": str(info.topic_type_hash),
        "gid": list(info.endpoint_gid),
        "reliability": qos.reliability.name,
        "durability": qos.durability.name,
        "lifespan": qos.lifespan.nanoseconds,
        "deadline": qos.deadline.nanoseconds,
        "liveliness": qos.liveliness.name,
        "lease": qos.liveliness_lease_duration.nanoseconds,
    }


def main(name: str, namespace: str) -> None:
    rclpy.init(args=[])
    node = Node(name, namespace=namespace)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    peer, ended = Peer(node), Future()

    async def obey(number: int, method: str, arguments: list[Any]) -> None:
        answer: list[Any]
        try:
            result = getattr(peer, method)(*arguments)
            answer = [number, await result if inspect.isawaitable(result) else result, None]
        except Exception:
            answer = [number, None, traceback.format_exc()]
        print(json.dumps(answer), flush=True)

    def read() -> None:
        for line in sys.stdin:
            executor.create_task(obey, *json.loads(line))
        executor.create_task(ended.set_result, None)

    threading.Thread(target=read, daemon=True).start()
    executor.spin_until_future_complete(ended)
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main(*sys.argv[1:])
