"""Parameters, QoS overrides and logs between real nodes, through rclpy's public names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from deploy.runtime.tests.conformance.middleware import announced_history
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

from rcl_interfaces.msg import (
    FloatingPointRange,
    Log,
    ParameterDescriptor,
    ParameterEvent,
    ParameterType,
    SetParametersResult,
)
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.parameter_event_handler import ParameterEventHandler
from rclpy.qos import (
    DurabilityPolicy,
    LivelinessPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)
from rclpy.qos_overriding_options import InvalidQosOverridesError, QoSOverridingOptions
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


def test_names_are_listed_by_prefix_and_depth(client: AsyncParameterClient, result: Result) -> None:
    listed = result(client.list_parameters()).result
    assert {"speed", "serial", "joint.count", "joint.left.name"} <= set(listed.names)
    assert {"joint", "joint.left"} <= set(listed.prefixes)
    assert set(result(client.list_parameters(["joint"])).result.names) == {"joint.count", "joint.left.name"}
    assert list(result(client.list_parameters(["joint"], depth=1)).result.names) == ["joint.count"]


def test_values_types_and_descriptors_are_read(client: AsyncParameterClient, result: Result) -> None:
    speed, serial, count = result(client.get_parameters(["speed", "serial", "joint.count"])).values
    assert (speed.double_value, serial.string_value, count.integer_value) == (0.5, "A7", 3)
    types = result(client.get_parameter_types(["speed", "serial"])).types
    assert list(types) == [ParameterType.PARAMETER_DOUBLE, ParameterType.PARAMETER_STRING]
    speed, serial = result(client.describe_parameters(["speed", "serial"])).descriptors
    assert (speed.name, speed.type) == ("speed", ParameterType.PARAMETER_DOUBLE)
    assert (speed.description, speed.floating_point_range[0].to_value) == ("of the effector [m/s]", 2.0)
    assert (speed.read_only, serial.read_only) == (False, True)


def test_an_undeclared_parameter_has_no_value_and_no_descriptor(
    client: AsyncParameterClient, result: Result
) -> None:
    assert list(result(client.get_parameters(["missing"])).values) == []
    assert list(result(client.describe_parameters(["missing"])).descriptors) == []


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


def test_parameters_are_set_together_or_not_at_all(
    server: Node, client: AsyncParameterClient, result: Result
) -> None:
    good = Parameter("joint.count", value=7)
    for bad in (Parameter("missing", value=1), Parameter("speed", value=-1.0)):
        refused = result(client.set_parameters_atomically([good, bad])).result
        assert not refused.successful
    assert "speed" in refused.reason
    assert server.get_parameter("joint.count").value == 3
    both = [good, Parameter("speed", value=1.0).to_parameter_msg()]
    assert result(client.set_parameters_atomically(both)).result.successful
    assert [server.get_parameter(name).value for name in ("joint.count", "speed")] == [7, 1.0]


def test_only_a_dynamically_typed_parameter_can_be_deleted(
    server: Node, client: AsyncParameterClient, result: Result
) -> None:
    assert [answer.successful for answer in result(client.delete_parameters(["note", "speed"])).results] == [
        True,
        False,
    ]
    assert (server.has_parameter("note"), server.has_parameter("speed")) == (False, True)


def test_a_file_is_loaded(server: Node, client: AsyncParameterClient, result: Result, tmp_path: Path) -> None:
    path = tmp_path / "parameters.yaml"
    path.write_text("/arm/server:\n  ros__parameters:\n    speed: 1.25\n    joint:\n      count: 6\n")
    results = result(client.load_parameter_file(str(path))).results
    assert [answer.successful for answer in results] == [True, True]
    assert [server.get_parameter(name).value for name in ("speed", "joint.count")] == [1.25, 6]
    path.write_text("/**: {ros__parameters: {speed: 0.25}}\n/arm/server: {ros__parameters: {note: new}}\n")
    assert result(client.load_parameter_file_atomically(str(path), use_wildcard=True)).result.successful
    assert [server.get_parameter(name).value for name in ("speed", "note")] == [0.25, "new"]


def test_a_callback_gets_the_future_of_its_call(client: AsyncParameterClient, spin_until: SpinUntil) -> None:
    done: list[Future] = []
    future = client.get_parameters(["speed"], callback=done.append)
    spin_until(lambda: done)
    assert done == [future]
    assert future.result().values[0].double_value == 0.5


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


def test_a_refused_change_is_not_published(
    client: AsyncParameterClient, events: list[ParameterEvent], result: Result, spin_until: SpinUntil
) -> None:
    result(client.set_parameters([Parameter("speed", value=-1.0), Parameter("serial", value="B8")]))
    result(
        client.set_parameters_atomically([Parameter("speed", value=1.0), Parameter("joint.count", value=4)])
    )
    spin_until(lambda: events)
    assert [summary(event) for event in events] == [({}, {"speed": 1.0, "joint.count": 4}, set())]


def test_callbacks_get_their_parameter_or_all_events(
    server: Node, asking: Node, spin_until: SpinUntil
) -> None:
    handler = ParameterEventHandler(asking)
    heard: list[tuple[str, object]] = []

    def note(kind: str) -> Callable[[Any], None]:
        return lambda message: heard.append((kind, Parameter.from_parameter_msg(message).value))

    handler.add_parameter_callback("speed", "/arm/server", note("absolute"))
    handle = handler.add_parameter_callback("speed", "server", note("relative"))
    handler.add_parameter_callback("speed", "", note("same node"))
    handler.add_parameter_event_callback(lambda event: heard.append(("event", event.node)))
    spin_until(lambda: handler.parameter_event_subscription.get_publisher_count() == 2)
    server.set_parameters([Parameter("speed", value=1.5)])
    spin_until(lambda: len(heard) == 3)
    assert sorted(heard) == [("absolute", 1.5), ("event", "/arm/server"), ("relative", 1.5)]

    heard.clear()
    handler.remove_parameter_callback(handle)
    asking.declare_parameter("speed", 9.0)
    server.set_parameters([Parameter("joint.count", value=4)])
    server.set_parameters([Parameter("speed", value=1.0)])
    spin_until(lambda: ("absolute", 1.0) in heard and len(heard) == 5)
    assert sorted(heard) == [
        ("absolute", 1.0),
        ("event", "/arm/asking"),
        ("event", "/arm/server"),
        ("event", "/arm/server"),
        ("same node", 9.0),
    ]
    handler.destroy()


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


def test_only_policies_declared_overridable_are_overridden(
    make_node: MakeNode, asking: Node, spin_until: SpinUntil
) -> None:
    overrides = overridden(
        reliability="best_effort",
        durability="transient_local",
        liveliness="manual_by_topic",
        deadline=10**9,
        liveliness_lease_duration=2 * 10**9,
        lifespan=3 * 10**9,
    )
    node = make_node("node", namespace="/arm", parameter_overrides=overrides)
    default = QoSOverridingOptions.with_default_policies()
    node.create_publisher(Float64, "x", QoSProfile(depth=1), qos_overriding_options=default)
    times = QoSOverridingOptions(
        [
            QoSPolicyKind.LIVELINESS,
            QoSPolicyKind.DEADLINE,
            QoSPolicyKind.LIVELINESS_LEASE_DURATION,
            QoSPolicyKind.LIFESPAN,
        ]
    )
    node.create_subscription(
        Float64, "x", lambda message: None, QoSProfile(depth=1), qos_overriding_options=times
    )
    publisher = effective_qos(asking.get_publishers_info_by_topic, spin_until)
    assert publisher.reliability == ReliabilityPolicy.BEST_EFFORT
    assert publisher.durability == DurabilityPolicy.VOLATILE
    assert publisher.liveliness == LivelinessPolicy.AUTOMATIC
    subscription = effective_qos(asking.get_subscriptions_info_by_topic, spin_until)
    assert subscription.reliability == ReliabilityPolicy.RELIABLE
    assert subscription.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC
    assert subscription.deadline == Duration(seconds=1)
    assert subscription.liveliness_lease_duration == Duration(seconds=2)


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


def test_a_profile_that_the_callback_rejects_creates_nothing(make_node: MakeNode, asking: Node) -> None:
    def deep(qos: QoSProfile) -> SetParametersResult:
        return SetParametersResult(successful=qos.depth > 5, reason=f"a depth of {qos.depth} is too little")

    node = make_node("node", namespace="/arm", parameter_overrides=overridden(depth=3))
    options = QoSOverridingOptions.with_default_policies(callback=deep)
    with pytest.raises(InvalidQosOverridesError, match="a depth of 3 is too little"):
        node.create_publisher(Float64, "x", QoSProfile(depth=10), qos_overriding_options=options)
    assert asking.get_publishers_info_by_topic("x") == []


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
