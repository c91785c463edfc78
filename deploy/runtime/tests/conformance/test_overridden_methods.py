"""Subclasses of Node that override its public methods, with only the parameters that rclpy itself passes."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import pytest
from deploy.runtime.tests.nodes import SpinUntil

from builtin_interfaces.msg import Time
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.wait_for_message import wait_for_message
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64

SIMULATED = Parameter("use_sim_time", value=True)
PARAMETER_SERVICES = [
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
]
Make = Callable[..., Any]


@pytest.fixture
def make(context: Context) -> Iterator[Make]:
    with ExitStack() as stack:

        def make(cls: type[Node], **options: Any) -> Any:
            node = cls("node", context=context, **options)
            stack.callback(node.destroy_node)
            return node

        yield make


def test_create_publisher_may_know_only_type_topic_and_qos(make: Make) -> None:
    topics: list[str] = []

    class Mine(Node):
        def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any) -> Any:  # type: ignore[override]
            topics.append(topic)
            return super().create_publisher(msg_type, topic, qos_profile)

    node = make(Mine)
    node.create_publisher(Float64, "x", 1)
    assert topics == ["/parameter_events", "x"]


def test_create_timer_may_know_only_period_and_callback(make: Make) -> None:
    callbacks: list[Any] = []

    class Mine(Node):
        def create_timer(self, timer_period_sec: float, callback: Any) -> Any:  # type: ignore[override]
            callbacks.append(callback)
            return super().create_timer(timer_period_sec, callback)

        def destroy_timer(self, timer: Any) -> bool:
            raise AssertionError("rclpy has made a timer through the user's class")

    node = make(Mine, parameter_overrides=[SIMULATED])
    node.set_parameters([Parameter("use_sim_time", value=False)])
    assert callbacks == []


class OfFourArguments(Node):
    def __init__(self, *args: Any, **options: Any) -> None:
        self.subscribed: list[tuple[Any, str]] = []
        super().__init__(*args, **options)

    def create_subscription(self, msg_type: Any, topic: str, callback: Any, qos_profile: Any) -> Any:  # type: ignore[override]
        self.subscribed.append((msg_type, topic))
        return super().create_subscription(msg_type, topic, callback, qos_profile)


def test_create_subscription_may_know_only_four_parameters(
    make: Make, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    node = make(OfFourArguments, parameter_overrides=[SIMULATED])
    assert node.subscribed == [(Clock, "/clock")]
    executor.add_node(node)
    publisher = node.create_publisher(Clock, "/clock", 1)
    publisher.publish(Clock(clock=Time(sec=5)))
    spin_until(lambda: node.get_clock().now().nanoseconds == 5_000_000_000)


def test_wait_for_message_subscribes_through_the_users_class(make: Make) -> None:
    node = make(OfFourArguments)
    assert wait_for_message(Float64, node, "x", time_to_wait=0.01) == (False, None)
    assert node.subscribed == [(Float64, "x")]


def test_create_service_is_called_for_the_parameter_services(make: Make) -> None:
    names: list[str] = []

    class Mine(Node):
        def create_service(  # type: ignore[override]
            self, srv_type: Any, srv_name: str, callback: Any, *, qos_profile: Any
        ) -> Any:
            names.append(srv_name)
            return super().create_service(srv_type, srv_name, callback, qos_profile=qos_profile)

    make(Mine)
    assert sorted(names) == [f"node/{name}" for name in PARAMETER_SERVICES]


def test_the_users_getters_are_not_asked_before_the_user_is_ready(make: Make) -> None:
    class Mine(Node):
        def get_logger(self) -> Any:
            raise AssertionError("the user's class is not initialized yet")

        def get_clock(self) -> Any:
            raise AssertionError("the user's class is not initialized yet")

    node = make(Mine)
    node.create_subscription(Float64, "x", print, 1)
    node.declare_parameter("a", 1)


def test_a_name_of_the_users_own_does_not_change_the_graph(make: Make) -> None:
    class Mine(Node):
        def get_name(self) -> str:
            return "robot_7"

        def get_namespace(self) -> str:
            return "/factory"

    node = make(Mine, start_parameter_services=False)
    assert ("node", "/") in Node.get_node_names_and_namespaces(node)
