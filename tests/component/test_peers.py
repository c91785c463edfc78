"""Other types, rivals and loops on the topics and services of a node are problems with names."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import rclpy
from geometry_msgs.msg import Twist
from rclpy.context import Context
from rclpy.node import Node
from reactivex.subject import Subject
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import SetBool, Trigger

from interfaces import topics
from interfaces.service import Rejected, ServiceNode, UserError
from interfaces.service import peers as peers_module
from interfaces.service.peers import real_name
from interfaces.topics import Topic
from reactive_node.strangers import Endpoint
from reactive_node.testing import MakeNode, SpinUntil
from services.examples import twist_gate

Problems = set[tuple[str, str]]


@contextmanager
def stranger(name: str, namespace: str = "") -> Iterator[Node]:
    """A node of another process: Fast DDS has no topic of two types within a context."""
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node(name, namespace=namespace, context=context)
    try:
        yield node
    finally:
        node.destroy_node()
        rclpy.shutdown(context=context)


def problems(service: ServiceNode) -> Problems:
    return {*service.peers.problems()}


def written(service: ServiceNode, *outputs: Topic) -> None:
    for topic in outputs:
        service.publish(topic, Subject())


ONE_PUBLISHER = [topic for topic in topics.CONTRACT if len(topic.publishers) == 1 and topic.name[0] != "/"]


def test_subscriber_that_expects_another_type_is_named(service: ServiceNode, spin_until: SpinUntil) -> None:
    written(service, *topics.CONTRACT)
    with stranger("base", "/robot") as base:
        for topic in topics.CONTRACT:
            other = String if topic.type is not String else Float64
            base.create_subscription(other, f"/{topic.name.lstrip('/')}", lambda _: None, 1)
        expected = {
            (it.name, f"/robot/base expects std_msgs/msg/{'String' if it.type is not String else 'Float64'}")
            for it in topics.CONTRACT
        }
        spin_until(lambda: problems(service) == expected)
    spin_until(lambda: not problems(service))


def test_subscriber_that_expects_another_qos_is_named(service: ServiceNode, spin_until: SpinUntil) -> None:
    written(service, topics.ENGINES, topics.L1, topics.OPERATOR_HEARTBEAT)
    with stranger("base") as base:
        base.create_subscription(String, "engines", lambda _: None, topics.L1.qos)
        base.create_subscription(Bool, "operator_heartbeat", lambda _: None, topics.ENGINES.qos)
        base.create_subscription(Float64, "l1", lambda _: None, topics.OPERATOR_HEARTBEAT.qos)
        expected = {
            ("engines", "base expects a transient local publisher"),
            ("operator_heartbeat", "base expects a reliable publisher"),
        }
        spin_until(lambda: problems(service) == expected)


def test_other_publisher_of_an_output_is_named(service: ServiceNode, spin_until: SpinUntil) -> None:
    written(service, *topics.CONTRACT)
    assert not problems(service)
    with stranger("docking_server") as docking_server:
        for topic in topics.CONTRACT:
            docking_server.create_publisher(topic.type, topic.name, topic.qos)
        expected = {(topic.name, "docking_server publishes it, too") for topic in ONE_PUBLISHER}
        spin_until(lambda: problems(service) == expected)
    spin_until(lambda: not problems(service))


def test_publisher_of_a_topic_with_many_publishers_is_no_rival(
    service: ServiceNode, make_node: MakeNode, spin_until: SpinUntil
) -> None:
    shared = [topics.ENGINES, topics.OPERATOR_HEARTBEAT, topics.DIAGNOSTICS]
    written(service, *shared)
    guard = make_node("own_guard", kind=Node)
    for topic in shared:
        guard.create_publisher(topic.type, topic.name, topic.qos)
    spin_until(lambda: all(service.count_publishers(topic.name) >= 2 for topic in shared))
    assert not problems(service)


def test_rival_of_the_same_name_is_reported_when_it_stays(
    service: ServiceNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peers_module, "_PATIENCE", 3)
    written(service, topics.L1, topics.L2)
    with stranger("service") as twin:
        twin.create_publisher(Float64, "l1", topics.L1.qos)
        spin_until(lambda: [it.namespace for it in service.publishers_of("l1")] == ["/", "/"])
        found = [problems(service) for _ in range(4)]
    assert found == [set(), set(), *[{("l1", "another service publishes it, too")}] * 2]
    spin_until(lambda: service.count_publishers("l1") == 1)
    assert not problems(service)


def test_rival_without_a_node_is_reported_when_it_stays(
    service: ServiceNode, make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(peers_module, "_PATIENCE", 2)
    written(service, topics.L1)
    make_node("peer", kind=Node).create_publisher(Float64, "l1", topics.L1.qos)
    spin_until(lambda: service.count_publishers("l1") == 2)
    own = Endpoint("service", "/", "std_msgs/msg/Float64", ())
    bare = Endpoint("_NODE_NAME_UNKNOWN_", "_NODE_NAMESPACE_UNKNOWN_", "std_msgs/msg/Float64", ())
    monkeypatch.setattr(service, "publishers_of", lambda _: [own, bare])
    assert [problems(service) for _ in range(2)] == [
        set(),
        {("l1", "a program without a node publishes it, too")},
    ]


@pytest.mark.parametrize("remap", ["cmd_vel_in:=cmd_vel", "cmd_vel:=cmd_vel_in", "cmd_vel_in:=/arm1/cmd_vel"])
def test_service_that_would_hear_itself_is_refused(make_node: MakeNode, remap: str) -> None:
    gate = make_node("gate", kind=ServiceNode, namespace="/arm1", cli_args=["--ros-args", "-r", remap])
    with pytest.raises(UserError, match=r"cmd_vel_in: /arm1/cmd_vel\w* is what cmd_vel publishes; remap one"):
        twist_gate.wire(gate)


def test_service_may_read_what_it_publishes_by_contract(service: ServiceNode) -> None:
    service.observe(topics.ENGINES).subscribe()
    written(service, topics.ENGINES)


def test_node_that_takes_an_output_back_to_an_input_is_named(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    gate = make_node("gate", kind=ServiceNode)
    twist_gate.wire(gate)
    base, joystick, relay = (make_node(name, kind=Node) for name in ("base", "joystick", "relay"))
    base.create_subscription(Twist, "cmd_vel", lambda _: None, 1)
    joystick.create_publisher(Twist, "cmd_vel_in", 1)
    spin_until(lambda: gate.count_subscribers("cmd_vel") == 1 and gate.count_publishers("cmd_vel_in") == 1)
    assert not problems(gate)
    relay.create_subscription(Twist, "cmd_vel", lambda _: None, 1)
    relay.create_publisher(Twist, "cmd_vel_in", 1)
    loop = ("cmd_vel_in", "relay reads cmd_vel and publishes this: a loop")
    spin_until(lambda: problems(gate) == {loop})


def test_service_of_another_type_is_named(service: ServiceNode, spin_until: SpinUntil) -> None:
    for _ in range(2):
        service.create_client(SetBool, "motor")
    assert not problems(service)
    with stranger("driver") as driver:
        driver.create_service(Trigger, "motor", lambda _, answer: answer)
        wrong = "it is a std_srvs/srv/Trigger, not a std_srvs/srv/SetBool"
        spin_until(lambda: [*service.peers.problems()] == [("motor", wrong)])


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ({}, "l1"),
        ({"namespace": "/arm1"}, "l1"),
        ({"cli_args": ["--ros-args", "-r", "l1:=/robot/length"]}, "/robot/length"),
        ({"namespace": "/arm1", "cli_args": ["--ros-args", "-r", "l1:=length"]}, "/arm1/length"),
    ],
)
def test_topic_is_reported_by_its_real_name(
    make_node: MakeNode, spin_until: SpinUntil, options: dict[str, Any], name: str
) -> None:
    service = make_node("service", kind=ServiceNode, **options)
    assert real_name(service, topics.L1) == name
    subjects: list[str] = []
    service.health.drop = lambda subject, _: subjects.append(subject)
    values: Subject[Any] = Subject()
    service.publish(topics.L1, values)
    service.observe(topics.L1).subscribe()
    values.on_next(math.nan)
    values.on_next(Rejected(topics.L1, "it is too long"))
    peer = make_node("peer", kind=Node, namespace=options.get("namespace", ""))
    publisher = peer.create_publisher(Float64, service.resolve_topic_name("l1"), topics.L1.qos)
    spin_until(publisher.get_subscription_count)
    publisher.publish(Float64(data=-1.0))
    spin_until(lambda: len(subjects) == 3)
    assert subjects == [name] * 3
    spin_until(lambda: problems(service) == {(name, "peer publishes it, too")})
