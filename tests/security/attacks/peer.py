"""A node that a test commands by lines of JSON: `peer.py NODE [ROS ARGUMENTS]` reads [METHOD, ARGUMENTS…].

It answers with the result, or with {"error": TEXT}. A first line says whether it could join.
"""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import rclpy
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy.subscription import Subscription

from interfaces import topics

TOPICS = {topic.name: topic for topic in topics.CONTRACT}


class Peer:
    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Publisher] = {}
        self._subscriptions: dict[str, Subscription] = {}
        self._heard: dict[str, list[Any]] = {}

    def advertise(self, name: str) -> None:
        topic = TOPICS[name]
        self._publishers[name] = self._node.create_publisher(topic.type, name, topic.qos)

    def publish(self, name: str, value: Any) -> int:
        """Publish a value; return how many readers match."""
        self._publishers[name].publish(TOPICS[name].message(value))
        return self._publishers[name].get_subscription_count()

    def read(self, name: str) -> None:
        topic, heard = TOPICS[name], self._heard.setdefault(name, [])
        self._subscriptions[name] = self._node.create_subscription(
            topic.type, name, lambda message: heard.append(topic.value(message)), topic.qos
        )

    def heard(self, name: str) -> list[Any]:
        """Return the values since the last call."""
        heard = list(self._heard[name])
        self._heard[name].clear()
        return heard

    def writers(self, name: str) -> int:
        return self._subscriptions[name].get_publisher_count()

    def nodes(self) -> list[str]:
        return sorted(self._node.get_node_names())

    def set_parameter(self, node: str, name: str, value: Any, seconds: float) -> bool:
        """Set a parameter; return whether the node has answered within this time [s]."""
        client = self._node.create_client(SetParameters, f"{node}/set_parameters")
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        deadline = time.monotonic() + seconds
        if not client.wait_for_service(timeout_sec=seconds):
            return False
        answer = client.call_async(request)
        rclpy.spin_until_future_complete(self._node, answer, timeout_sec=deadline - time.monotonic())
        return answer.done()


def answer(result: Any) -> None:
    print(json.dumps(result), flush=True)


def main() -> None:
    try:
        rclpy.init(args=sys.argv[2:], signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node(sys.argv[1])
    except RuntimeError as error:
        answer({"error": str(error)})
        return
    answer(None)
    peer = Peer(node)
    for line in sys.stdin:
        method, *arguments = json.loads(line)
        try:
            for _ in range(20):  # what has come
                rclpy.spin_once(node, timeout_sec=0)
            answer(getattr(peer, method)(*arguments))
        except Exception as error:
            answer({"error": str(error)})


if __name__ == "__main__":
    main()
