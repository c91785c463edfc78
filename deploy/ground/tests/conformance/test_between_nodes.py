"""Parameters, QoS overrides and logs between real nodes, through rclpy's public names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from deploy.ground.tests.conformance.middleware import announced_history
from deploy.ground.tests.nodes import MakeNode, SpinUntil
from rcl_interfaces.msg import (
    FloatingPointRange,
    Log,
    ParameterDescriptor,
    ParameterEvent,
    SetParametersResult,
)
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import (
    DurabilityPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.task import Future
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import Float64

Result = Callable[[Future], Any]


@pytest.fixture
def server(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    """A node with parameters; some are read-only, some have ranges."""
    node = make_node("server", namespace="/arm")
    executor.add_node(node)
    speed = ParameterDescriptor(
        description="of the effector [m/s]",
        floating_point_range=[FloatingPointRange(from_value=0.0, to_value=2.0)],
    )
    node.declare_parameter("speed", 0.5, speed)
    node.declare_parameter("serial", "A7", ParameterDescriptor(read_only=True))
    node.declare_parameter("joint.count", 3)
    node.declare_parameter("joint.left.name", "elbow")
    node.declare_parameter("note", "old", ParameterDescriptor(dynamic_typing=True))
    return node


@pytest.fixture
def asking(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    node = make_node("asking", namespace="/arm")
    executor.add_node(node)
    return node


@pytest.fixture
def client(server: Node, asking: Node, spin_until: SpinUntil) -> AsyncParameterClient:
    client = AsyncParameterClient(asking, "/arm/server")
    spin_until(client.services_are_ready)
    return client


@pytest.fixture
def result(spin_until: SpinUntil) -> Result:
    def wait(future: Future) -> Any:
        spin_until(future.done)
        return future.result()

    return wait


@pytest.fixture
def events(client: AsyncParameterClient, spin_until: SpinUntil) -> list[ParameterEvent]:
    heard: list[ParameterEvent] = []

    def hear(event: ParameterEvent) -> None:
        if event.node == "/arm/server":
            heard.append(event)

    subscription = client.on_parameter_event(hear)
    spin_until(lambda: subscription.get_publisher_count() == 2)
    return heard


def summary(event: ParameterEvent) -> tuple[dict[str, object], dict[str, object], set[str]]:
    """New and changed parameters with their values, and the names of deleted ones."""
    new, changed, gone = (
        {message.name: Parameter.from_parameter_msg(message).value for message in messages}
        for messages in (event.new_parameters, event.changed_parameters, event.deleted_parameters)
    )
    return new, changed, set(gone)


# Parameter services


def test_each_parameter_is_set_or_refused_with_a_reason(
    server: Node, client: AsyncParameterClient, result: Result
) -> None:
    def even(parameters: list[Parameter]) -> SetParametersResult:
        odd = any(parameter.name == "joint.count" and parameter.value % 2 for parameter in parameters)
        return SetParametersResult(successful=not odd, reason="an odd count" if odd else "")

    server.add_on_set_parameters_callback(even)
    wanted = [
        Parameter("speed", value=1.5),
        Parameter("speed", value=2.5),
        Parameter("speed", value="fast"),
        Parameter("serial", value="B8"),
        Parameter("joint.count", value=5),
        Parameter("joint.count", value=4).to_parameter_msg(),
        Parameter("missing", value=1),
    ]
    results = result(client.set_parameters(wanted)).results
    assert [answer.successful for answer in results] == [True, False, False, False, False, True, False]
    reasons = [answer.reason for answer in results]
    assert reasons[0] == reasons[5] == ""
    for reason, fragments in (
        (reasons[1], ("speed", "2.5", "2.0")),
        (reasons[2], ("Wrong parameter type", "DOUBLE", "STRING")),
        (reasons[3], ("read-only", "serial")),
        (reasons[4], ("an odd count",)),
        (reasons[6], ("undeclared parameter",)),
    ):
        assert all(fragment in reason for fragment in fragments), reason
    values = [server.get_parameter(name).value for name in ("speed", "serial", "joint.count")]
    assert values == [1.5, "A7", 4]


def test_a_client_is_ready_while_its_server_has_all_services(
    asking: Node, make_node: MakeNode, executor: SingleThreadedExecutor, result: Result, spin_until: SpinUntil
) -> None:
    client = AsyncParameterClient(asking, "/late")
    assert not client.services_are_ready()
    assert not client.wait_for_services(timeout_sec=0.05)
    call = client.get_parameters(["speed"])
    late = make_node("late")
    late.declare_parameter("speed", 3.0)
    executor.add_node(late)
    assert client.wait_for_services(timeout_sec=10.0)
    assert result(client.get_parameters(["speed"])).values[0].double_value == 3.0
    assert not call.done()  # a request is not kept for later servers
    (listing,) = (service for service in late.services if service.srv_name.endswith("/list_parameters"))
    late.destroy_service(listing)
    spin_until(lambda: not client.services_are_ready())
    assert not client.wait_for_services(timeout_sec=0.0)


# /parameter_events


def test_every_change_is_published_as_a_parameter_event(
    server: Node, client: AsyncParameterClient, events: list[ParameterEvent], spin_until: SpinUntil
) -> None:
    before = server.get_clock().now()
    client.set_parameters([Parameter("speed", value=1.5)])
    spin_until(lambda: len(events) == 1)
    server.declare_parameter("extra", "x")
    server.set_parameters([Parameter("joint.count", value=4)])
    client.delete_parameters(["note"])
    spin_until(lambda: len(events) == 4)
    summaries = [summary(event) for event in events]
    assert summaries[0] == ({}, {"speed": 1.5}, set())
    assert summaries[1] == ({"extra": "x"}, {}, set())
    assert summaries[2] == ({}, {"joint.count": 4}, set())
    assert summaries[3] == ({}, {}, {"note"})
    for event in events:
        stamp = event.stamp.sec * 10**9 + event.stamp.nanosec
        assert before.nanoseconds <= stamp <= server.get_clock().now().nanoseconds


# QoS overrides


def overridden(**policies: object) -> list[Parameter]:
    return [
        Parameter(f"qos_overrides./arm/x.{kind}.{name}", value=value)
        for kind in ("publisher", "subscription")
        for name, value in policies.items()
    ]


def effective_qos(
    endpoints_of: Callable[[str], list[TopicEndpointInfo]], spin_until: SpinUntil
) -> QoSProfile:
    """The QoS of the only publisher or subscription of ``x``, once it is discovered."""
    spin_until(lambda: endpoints_of("x"))
    (info,) = endpoints_of("x")
    return info.qos_profile


def test_parameters_override_the_qos_of_the_endpoints(
    make_node: MakeNode, asking: Node, spin_until: SpinUntil
) -> None:
    overrides = overridden(
        history="keep_last", depth=7, reliability="best_effort", durability="transient_local"
    )
    node = make_node("node", namespace="/arm", parameter_overrides=overrides)
    options = QoSOverridingOptions(
        [QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY]
    )
    node.create_publisher(Float64, "x", QoSProfile(depth=1), qos_overriding_options=options)
    node.create_subscription(
        Float64, "x", lambda message: None, QoSProfile(depth=1), qos_overriding_options=options
    )
    for endpoints_of in (asking.get_publishers_info_by_topic, asking.get_subscriptions_info_by_topic):
        qos = effective_qos(endpoints_of, spin_until)
        assert (qos.history, qos.depth) == announced_history(7)
        assert qos.reliability == ReliabilityPolicy.BEST_EFFORT
        assert qos.durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_parameter_names_contain_the_entity_id_and_the_remapped_topic(
    make_node: MakeNode, asking: Node, spin_until: SpinUntil
) -> None:
    arguments = ["-r", "x:=y", "-p", "qos_overrides./arm/y.publisher_left.depth:=9"]
    node = make_node("node", namespace="/arm", cli_args=["--ros-args", *arguments])
    options = QoSOverridingOptions.with_default_policies(entity_id="left")
    publisher = node.create_publisher(Float64, "x", QoSProfile(depth=1), qos_overriding_options=options)
    assert publisher.topic_name == "/arm/y"
    spin_until(lambda: asking.get_publishers_info_by_topic("y"))
    qos = asking.get_publishers_info_by_topic("y")[0].qos_profile
    assert (qos.history, qos.depth) == announced_history(9)
    assert node.get_parameter("qos_overrides./arm/y.publisher_left.depth").value == 9


# /rosout


def test_log_messages_of_a_node_are_published_on_rosout(
    server: Node, asking: Node, spin_until: SpinUntil, capfd: pytest.CaptureFixture[str]
) -> None:
    heard: list[Log] = []
    latched = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    asking.create_subscription(Log, "/rosout", heard.append, latched)
    before = server.get_clock().now().nanoseconds
    server.get_logger().debug("not loud enough")
    server.get_logger().warning("the arm ist müde")
    server.get_logger().get_child("joint").error("it hurts")
    spin_until(lambda: len(heard) >= 2)
    warning, error = heard
    assert (warning.name, warning.level, warning.msg) == ("arm.server", 30, "the arm ist müde")
    assert (error.name, error.level, error.msg) == ("arm.server.joint", 40, "it hurts")
    assert Path(warning.file).name == Path(__file__).name
    assert warning.function == "test_log_messages_of_a_node_are_published_on_rosout"
    assert 0 < warning.line < error.line
    for message in heard:
        stamp = message.stamp.sec * 10**9 + message.stamp.nanosec
        assert before <= stamp <= server.get_clock().now().nanoseconds
    assert "the arm ist müde" in capfd.readouterr().err
