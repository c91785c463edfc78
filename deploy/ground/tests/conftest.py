"""Fixtures for the tests of rclpy: plain nodes, clocks, a second participant."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from deploy.ground.tests.host import ADDRESS, Host
from deploy.ground.tests.nodes import Call, MakeNode, SpinUntil
from geometry_msgs.msg import PointStamped
from rclpy.clock import ROSClock
from rclpy.context import Context
from rclpy.executors import (
    SingleThreadedExecutor,
)
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.time import Time
from rclpy.time_source import TimeSource
from std_msgs.msg import Bool, Float64, String
from std_srvs.srv import Trigger


@pytest.fixture
def executor(context: Context) -> Iterator[SingleThreadedExecutor]:
    with SingleThreadedExecutor(context=context) as executor:
        yield executor


@pytest.fixture
def make_node(context: Context) -> Iterator[Callable[..., Node]]:
    """Makes nodes in the test's context and destroys them after the test; no executor spins them."""
    with ExitStack() as stack:

        def make(name: str = "node", **options: Any) -> Node:
            node = Node(name, **{"context": context, **options})
            stack.callback(node.destroy_node)
            return node

        yield make


@pytest.fixture
def node(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    node = make_node()
    executor.add_node(node)
    return node


@pytest.fixture
def call(node: Node, spin_until: SpinUntil) -> Call:
    """Calls a service from ``node``, with the fields of the request; returns the response."""

    def call(srv_type: Any, name: str, **request: Any) -> Any:
        client = node.create_client(srv_type, name)
        spin_until(client.service_is_ready)
        future = client.call_async(srv_type.Request(**request))
        spin_until(future.done)
        return future.result()

    return call


@pytest.fixture
def facts_node(make_node: MakeNode) -> Node:
    """A node like the one that facts/discovery.txt was recorded from."""
    node = make_node("facts", namespace="/arm1")
    node.declare_parameter("value", 2.0)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    node.create_publisher(Float64, "l1", latched)
    node.create_publisher(PointStamped, "effector/position", 10)
    node.create_publisher(String, "/engines", 10)
    node.create_subscription(Bool, "operator_heartbeat", lambda _: None, qos_profile_sensor_data)
    node.create_service(Trigger, "turn_on", lambda request, response: response)
    return node


@pytest.fixture
def other_context(domain_id: int) -> Iterator[Context]:
    """A second participant in the test's domain, as another process would be."""
    context = Context()
    context.init([], domain_id=domain_id)
    yield context
    context.try_shutdown()
    context.destroy()


@pytest.fixture
def clock() -> ROSClock:
    clock, simulator = ROSClock(), TimeSource()
    simulator.ros_time_is_active = True
    simulator.attach_clock(clock)
    clock.set_ros_time_override(Time(nanoseconds=1000, clock_type=clock.clock_type))
    return clock


@pytest.fixture
def host(tmp_path: Path) -> Iterator[Host]:
    for program, package in (("ip", "iproute2"), ("unshare", "util-linux"), ("nsenter", "util-linux")):
        if shutil.which(program) is None:
            pytest.skip(f"no {program} here: apt-get install {package}")
    namespaces = [["--net"]] if os.geteuid() == 0 else []
    with ExitStack() as stack:
        for namespace in (*namespaces, ["--user", "--map-root-user", "--net"]):
            try:
                host = Host(namespace, tmp_path)
                stack.callback(host.close)
                host.add_interface("probe")
                host.ip("link delete probe")
            except OSError as error:
                reason = error
            else:
                break
        else:
            pytest.skip(f"platform: no network namespaces here: {reason}")
        yield host


@pytest.fixture
def host_with_network(host: Host) -> Host:
    host.add_interface("eth0", ADDRESS)
    return host
