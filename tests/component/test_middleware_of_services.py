"""How a service keeps Fast DDS from shared memory, and packets from being lost."""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import pytest
from rclpy.node import Node
from std_msgs.msg import Float64

from interfaces.loopback import LOOPBACK_DOWN
from interfaces.service import middleware

BURST = 1000  # packets; a socket holds 280 of them by default
LARGEST_BUFFER = int(Path("/proc/sys/net/core/rmem_max").read_text())
READER = f"""
import rclpy
from interfaces.service import middleware
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64

with middleware.without_shared_memory():
    rclpy.init()
    node = rclpy.create_node("reader")
received = []
qos = QoSProfile(depth={BURST}, reliability=ReliabilityPolicy.BEST_EFFORT)
node.create_subscription(Float64, "burst", lambda message: received.append(message.data), qos)
while not received:
    rclpy.spin_once(node)
print("ready", flush=True)
while received[-1] != {BURST - 1}:
    rclpy.spin_once(node)
print(len([*filter(None, received)]))
"""
FASTDDS = Path("deploy/fastdds.xml").resolve()
LOCALHOST = FASTDDS.with_name("fastdds.localhost.xml")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ("SYSTEM_DEFAULT", LOCALHOST)),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, ("SUBNET", FASTDDS)),
        ({"ROS_STATIC_PEERS": "192.0.2.1"}, ("LOCALHOST", FASTDDS)),
        ({middleware.PROFILES: str(LOCALHOST)}, ("SYSTEM_DEFAULT", LOCALHOST)),
        ({"FASTRTPS_DEFAULT_PROFILES_FILE": "/users.xml"}, ("LOCALHOST", Path("/users.xml"))),
    ],
)
def test_only_our_settings_for_this_machine_change(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, str], expected: tuple[str, Path]
) -> None:
    settings = {middleware.RANGE: "LOCALHOST", middleware.PROFILES: str(FASTDDS), middleware.PEERS: ""}
    for name, value in (settings | changes).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(middleware, "get_rmw_implementation_identifier", lambda: "rmw_fastrtps_cpp")
    before = dict(os.environ)
    with middleware.without_shared_memory():
        assert (os.environ[middleware.RANGE], Path(os.environ[middleware.PROFILES])) == expected
    assert os.environ == before


@pytest.mark.parametrize(
    ("rmw", "changes", "why"),
    [
        ("rmw_fastrtps_cpp", {}, ""),
        ("rmw_fastrtps_cpp", {middleware.RANGE: "SUBNET", middleware.PROFILES: "/mine.xml"}, ""),
        ("rmw_fastrtps_cpp", {middleware.PROFILES: "/mine.xml"}, "there is no /mine.localhost.xml"),
        ("rmw_fastrtps_cpp", {middleware.PEERS: "192.0.2.1"}, "ROS_STATIC_PEERS is set"),
        ("rmw_cyclonedds_cpp", {middleware.PEERS: "192.0.2.1"}, ""),
    ],
)
def test_what_brings_shared_memory_back_is_known(
    monkeypatch: pytest.MonkeyPatch, rmw: str, changes: dict[str, str], why: str
) -> None:
    settings = {middleware.RANGE: "LOCALHOST", middleware.PROFILES: str(FASTDDS), middleware.PEERS: ""}
    for name, value in (settings | changes).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(middleware, "get_rmw_implementation_identifier", lambda: rmw)
    assert middleware.shared_memory() == why


def test_other_middleware_keeps_the_range(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(middleware.RANGE, "LOCALHOST")
    monkeypatch.setenv(middleware.PROFILES, str(FASTDDS))
    monkeypatch.setattr(middleware, "get_rmw_implementation_identifier", lambda: "rmw_cyclonedds_cpp")
    with middleware.without_shared_memory():
        assert os.environ[middleware.RANGE] == "LOCALHOST"


@pytest.mark.parametrize("rmw", ["rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"])
@pytest.mark.parametrize(("reach", "is_refused"), [("LOCALHOST", True), ("SUBNET", False)])
def test_no_node_joins_without_the_loopback_interface(
    monkeypatch: pytest.MonkeyPatch, rmw: str, reach: str, is_refused: bool
) -> None:
    monkeypatch.setenv(middleware.RANGE, reach)
    monkeypatch.delenv(middleware.PEERS, raising=False)
    monkeypatch.setattr(middleware, "get_rmw_implementation_identifier", lambda: rmw)
    monkeypatch.setattr(middleware, "loopback_is_up", lambda: False)
    outcome = pytest.raises(RuntimeError, match=LOOPBACK_DOWN) if is_refused else nullcontext()
    with outcome, middleware.without_shared_memory():
        pass


@pytest.mark.skipif(LARGEST_BUFFER < 10**6, reason=f"platform: net.core.rmem_max is only {LARGEST_BUFFER}")
def test_process_that_stands_still_loses_no_packet(make_node: Callable[..., Node]) -> None:
    publisher = make_node().create_publisher(Float64, "burst", 10)
    with subprocess.Popen([sys.executable, "-c", READER], stdout=subprocess.PIPE, text=True) as reader:
        last_resort = threading.Timer(150.0, reader.kill)
        last_resort.start()
        assert reader.stdout is not None
        while not select.select([reader.stdout], [], [], 0.05)[0]:
            publisher.publish(Float64())  # until the reader knows the publisher
        assert reader.stdout.readline() == "ready\n"
        reader.send_signal(signal.SIGSTOP)
        for number in range(1, BURST):
            publisher.publish(Float64(data=float(number)))
        reader.send_signal(signal.SIGCONT)
        received = reader.communicate()[0]
        last_resort.cancel()
    assert int(received) == BURST - 1
