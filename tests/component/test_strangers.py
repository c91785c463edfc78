"""What strangers send to rclpy's own services and topics, and what they call themselves, ends no service."""

from __future__ import annotations

import os
import re
import resource
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rcl_interfaces.msg import Parameter, ParameterEvent, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter as Given
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64

from deploy.commands.setup import CYCLONEDDS_WHEELS
from deploy.operator.hand import Hand
from deploy.operator.remote import PARAMETER_EVENTS
from deploy.supervision.flood import Flood
from deploy.supervision.processes import ROOT
from interfaces import topics
from interfaces.service import ServiceNode
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinUntil
from tests.messages import messages

UNKNOWN = ParameterValue(type=99)
needs_package = pytest.mark.skipif(
    sys.version_info[:2] > CYCLONEDDS_WHEELS,
    reason="platform: PyPI has no Python package of Cyclone DDS for this Python",
)


@pytest.fixture
def service(make_node: MakeNode) -> ServiceNode:
    node: ServiceNode = make_node("service", kind=ServiceNode)
    node.declare_parameter("value", 1.0)
    return node


@pytest.fixture
def timed(make_node: MakeNode) -> ServiceNode:
    simulated = Given("use_sim_time", value=True)
    node: ServiceNode = make_node("timed", kind=ServiceNode, parameter_overrides=[simulated])
    return node


@pytest.mark.parametrize("type_", [SetParameters, SetParametersAtomically])
def test_request_with_an_unknown_type_ends_no_service(
    service: ServiceNode, peer: Node, spin_until: SpinUntil, type_: Any
) -> None:
    name = "set_parameters" if type_ is SetParameters else "set_parameters_atomically"
    client = peer.create_client(type_, f"service/{name}")
    spin_until(client.service_is_ready)

    def ask(value: ParameterValue) -> None:
        answer = client.call_async(type_.Request(parameters=[Parameter(name="value", value=value)]))
        spin_until(answer.done)

    ask(UNKNOWN)
    ask(Given("value", value=2.5).to_parameter_msg().value)
    assert service.get_parameter("value").value == 2.5


@needs_package
def test_request_that_lies_about_its_length_takes_no_memory(
    service: ServiceNode, peer: Node, spin_until: SpinUntil, domain_id: int
) -> None:
    client = peer.create_client(SetParameters, "service/set_parameters")
    spin_until(client.service_is_ready)
    limits = resource.getrlimit(resource.RLIMIT_DATA)
    before = from_now_on()
    liar = [sys.executable, "-m", "tests.dds_liar", str(domain_id), "service", "1000000"]
    with subprocess.Popen(liar, cwd=ROOT) as process:
        spin_until(lambda: process.poll() is not None)
    assert process.returncode == 0
    good = [Given("value", value=2.5).to_parameter_msg()]
    spin_until(client.call_async(SetParameters.Request(parameters=good)).done)
    assert service.get_parameter("value").value == 2.5
    assert peak() - before < 100 * 2**20
    assert resource.getrlimit(resource.RLIMIT_DATA) == limits


def from_now_on() -> int:
    """Begin to look for the peak of the memory of this process; return what it has now, in octets."""
    Path("/proc/self/clear_refs").write_text("5")
    return peak()


def peak() -> int:
    (found,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(found) * 1024


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_any_request_for_parameters_is_answered(service: ServiceNode, data: st.DataObject) -> None:
    own = [each for each in service.services if "parameter" in each.srv_name]
    assert len(own) == 6
    asked = data.draw(st.sampled_from(own))
    response = asked.callback(data.draw(messages(asked.srv_type.Request)), asked.srv_type.Response())
    assert isinstance(response, asked.srv_type.Response)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(time=messages(Clock))
def test_any_simulated_time_is_followed_or_dropped(timed: ServiceNode, time: Clock) -> None:
    (reader,) = (each for each in timed.subscriptions if each.topic_name == "/clock")
    for message in (time, Clock(clock=Time(sec=7))):
        reader.callback(message)
    assert timed.get_clock().now().nanoseconds == 7 * 10**9


def test_parameter_of_an_unknown_type_ends_no_terminal(
    make_node: MakeNode, peer: Node, spin_until: SpinUntil
) -> None:
    messages: list[str] = []
    dropped: list[tuple[str, str]] = []
    hand = Hand(make_node("terminal_7", kind=ReactiveNode), messages.append, lambda *why: dropped.append(why))
    hand.press()
    topic = PARAMETER_EVENTS
    strange = peer.create_publisher(topic.type, topic.name, topic.qos)
    spin_until(lambda: strange.get_subscription_count() >= 1)

    def set_pressed(value: ParameterValue) -> None:
        changed = [Parameter(name="pressed", value=value)]
        strange.publish(ParameterEvent(node="/dead_mans_switch", changed_parameters=changed))

    set_pressed(UNKNOWN)
    spin_until(lambda: dropped)
    assert dropped[0][0] == topic.name
    set_pressed(Given("pressed", value=True).to_parameter_msg().value)
    spin_until(lambda: not hand.holds)
    assert messages == ["Another hand has taken or released the switch."]


@contextmanager
def stranger(domain: int, name: bytes, *names: str) -> Iterator[None]:
    """A node of any name, which publishes numbers where other types belong."""
    program = [sys.executable, str(ROOT / "tests" / "dds_stranger.py"), str(domain), name.hex(), *names]
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    with subprocess.Popen(program, stdin=subprocess.PIPE, env=environment) as process:
        assert process.stdin
        try:
            yield
        finally:
            process.stdin.close()
            assert process.wait(timeout=150.0) == 0


UNREAD = "_NODE_NAME_UNKNOWN_"  # where the middleware does not read a name that is not UTF-8


@needs_package
@pytest.mark.parametrize(
    ("name", "shown"),
    [
        (b"\xff\xfe bad", ("\ufffd\ufffd bad", UNREAD)),
        (b"\x1b]0;PWNED\x07abc", ("\ufffd]0;PWNED\ufffdabc",)),
        (b"", ("\ufffd",)),
        (b"plain", ("plain",)),
    ],
)
def test_name_of_a_stranger_ends_no_service(
    make_node: MakeNode,
    service: ServiceNode,
    spin_until: SpinUntil,
    domain_id: int,
    name: bytes,
    shown: tuple[str, ...],
) -> None:
    read: list[Any] = []
    for topic in (topics.L1, topics.ENGINES):
        service.observe(topic).subscribe(read.append)
    viewer: ReactiveNode = make_node("viewer", kind=ReactiveNode)
    heard = ("/l1", "/engines", "/engines/state", "/operator_heartbeat", "/diagnostics")
    with stranger(domain_id, name, *heard):
        spin_until(lambda: all(service.count_publishers(topic) for topic in heard))
        spin_until(lambda: {it.node for it in viewer.publishers_of(topics.ENGINES.full_name("/"))} & {*shown})
        service.health.on_period()
        flood = Flood(viewer, ())
        flood.overflow()
        assert "these nodes are not of the arm" in flood.look()
    make_node("config_l1", kind=Node).create_publisher(Float64, "l1", topics.L1.qos).publish(
        Float64(data=2.5)
    )
    spin_until(lambda: read == [2.5])


@needs_package
def test_publisher_of_another_type_is_reported_whatever_its_name(
    service: ServiceNode, spin_until: SpinUntil, domain_id: int
) -> None:
    service.observe(topics.L1).subscribe()

    def is_remarked() -> bool:
        return bool({*service.peers.problems()} & known)

    unread = "a program without a node publishes std_msgs/msg/Int32"
    bad = "\ufffd\ufffd bad publishes"  # a graph that cannot read the name hides the type as well
    known = {("l1", f"{bad} another type"), ("l1", f"{bad} std_msgs/msg/Int32"), ("l1", unread)}
    with stranger(domain_id, b"\xff\xfe bad", "/l1"):
        spin_until(is_remarked)
