"""Topics between nodes on rclpy on Cyclone DDS and nodes on ROS 2's own, in both directions."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import pytest
from deploy.ground.tests.host import TIMEOUT, wait_until
from deploy.ground.tests.interop.conftest import PeerOn
from deploy.ground.tests.interop.processes import PAIRS, PeerProcess

FLOAT64 = "std_msgs/msg/Float64"
QOS: dict[str, dict[str, Any]] = {
    "state": {"depth": 1, "durability": "TRANSIENT_LOCAL"},
    "state for 400 ms": {"depth": 1, "durability": "TRANSIENT_LOCAL", "lifespan": 0.4},
    "event": {"depth": 1, "lifespan": 1.0},
    "events": {"depth": 10},
    "many events": {"depth": 100},
    "sign of life": {"depth": 1, "reliability": "BEST_EFFORT", "lifespan": 0.5},
}
MESSAGES = {
    "std_msgs/msg/Float64": ["std_msgs.msg.Float64(data=-0.1)", "std_msgs.msg.Float64(data=nan)"],
    "std_msgs/msg/Bool": ["std_msgs.msg.Bool(data=True)"],
    "std_msgs/msg/String": [
        "std_msgs.msg.String(data='')",
        "std_msgs.msg.String(data='Übergröße 机器人')",
        f"std_msgs.msg.String(data={'0123456789' * 20_000!r})",  # more than a datagram
    ],
    "std_msgs/msg/Header": [
        "std_msgs.msg.Header(stamp=builtin_interfaces.msg.Time(sec=-1, nanosec=999999999), frame_id='base')"
    ],
    "geometry_msgs/msg/PointStamped": [
        "geometry_msgs.msg.PointStamped("
        "header=std_msgs.msg.Header(stamp=builtin_interfaces.msg.Time(sec=1, nanosec=2), frame_id='base'), "
        "point=geometry_msgs.msg.Point(x=1.5, y=-inf, z=0.0))"
    ],
    "diagnostic_msgs/msg/DiagnosticArray": [
        "diagnostic_msgs.msg.DiagnosticArray("
        "header=std_msgs.msg.Header(stamp=builtin_interfaces.msg.Time(sec=1, nanosec=2), frame_id=''), "
        "status=["
        "diagnostic_msgs.msg.DiagnosticStatus(level=b'\\x01', name='/velocity', message='2 pairs', "
        "hardware_id='', values=[diagnostic_msgs.msg.KeyValue(key='pid', value='7')]), "
        "diagnostic_msgs.msg.DiagnosticStatus("
        "level=b'\\x00', name='', message='', hardware_id='', values=[])])"
    ],
    "sensor_msgs/msg/JointState": [
        "sensor_msgs.msg.JointState("
        "header=std_msgs.msg.Header(stamp=builtin_interfaces.msg.Time(sec=1, nanosec=2), frame_id='base'), "
        "name=['theta1', 'theta2'], position=[0.5, 1.0], velocity=[], effort=[])"
    ],
}

pytestmark = pytest.mark.parametrize(("writer", "reader"), PAIRS, indirect=True)


@pytest.fixture
def writer(request: pytest.FixtureRequest, peer_on: PeerOn) -> PeerProcess:
    return peer_on(request.param)


@pytest.fixture
def reader(request: pytest.FixtureRequest, peer_on: PeerOn) -> PeerProcess:
    return peer_on(request.param)


def value(number: float) -> str:
    return f"std_msgs.msg.Float64(data={number})"


def matched(writer: PeerProcess, reader: PeerProcess, topic: str) -> Callable[[], object]:
    return lambda: writer("readers", topic) and reader("writers", topic)


@pytest.mark.parametrize("type_name", MESSAGES)
def test_messages_arrive_as_they_were_sent(
    type_name: str, writer: PeerProcess, reader: PeerProcess, topic: str
) -> None:
    messages = MESSAGES[type_name]
    writer("advertise", topic, type_name, {"depth": 10})
    reader("subscribe", topic, type_name, {"depth": 10})
    wait_until(matched(writer, reader, topic))
    writer("publish", topic, *messages)
    wait_until(lambda: len(reader("received", topic)) >= len(messages))
    assert reader("received", topic) == messages


@pytest.mark.parametrize("qos", QOS)
def test_reader_gets_as_many_messages_as_the_qos_keeps(
    qos: str, writer: PeerProcess, reader: PeerProcess, topic: str
) -> None:
    writer("advertise", topic, FLOAT64, QOS[qos])
    reader("subscribe", topic, FLOAT64, QOS[qos])
    wait_until(matched(writer, reader, topic))
    messages = [value(float(number)) for number in range(QOS[qos]["depth"])]
    writer("publish", topic, *messages)
    wait_until(lambda: len(reader("received", topic)) >= len(messages))
    assert reader("received", topic) == messages


@pytest.mark.parametrize("qos", QOS)
def test_late_reader_gets_what_the_qos_keeps_for_it(
    qos: str, writer: PeerProcess, reader: PeerProcess, topic: str
) -> None:
    writer("advertise", topic, FLOAT64, QOS[qos])
    writer("publish", topic, value(1.0), value(2.0))
    lifespan = QOS[qos].get("lifespan", 0.0)
    time.sleep(2 * lifespan)  # the test is about the passing of this time
    reader("subscribe", topic, FLOAT64, QOS[qos])
    wait_until(matched(writer, reader, topic))
    is_kept = "durability" in QOS[qos] and not lifespan
    wait_until(lambda: reader("received", topic) or not is_kept)
    writer("publish", topic, value(3.0))
    expected = [value(2.0), value(3.0)] if is_kept else [value(3.0)]
    wait_until(lambda: len(reader("received", topic)) >= len(expected))
    assert reader("received", topic) == expected


def test_late_reader_gets_a_message_within_its_lifespan(
    writer: PeerProcess, reader: PeerProcess, topic: str
) -> None:
    qos = {"depth": 1, "durability": "TRANSIENT_LOCAL", "lifespan": TIMEOUT}
    writer("advertise", topic, FLOAT64, qos)
    writer("publish", topic, value(1.0), value(2.0))
    reader("subscribe", topic, FLOAT64, qos)
    wait_until(lambda: reader("received", topic))
    assert reader("received", topic) == [value(2.0)]


@pytest.mark.parametrize(
    ("offered", "requested", "policy"),
    [
        ({"depth": 1, "reliability": "BEST_EFFORT"}, {"depth": 1}, "RELIABILITY"),
        ({"depth": 1}, {"depth": 1, "durability": "TRANSIENT_LOCAL"}, "DURABILITY"),
    ],
)
def test_both_sides_report_a_writer_that_offers_too_little(
    offered: dict[str, Any],
    requested: dict[str, Any],
    policy: str,
    writer: PeerProcess,
    reader: PeerProcess,
    topic: str,
) -> None:
    writer("advertise", topic, FLOAT64, offered)
    reader("subscribe", topic, FLOAT64, requested)
    wait_until(lambda: writer("incompatible", topic) == reader("incompatible", topic) == [policy])
    assert (writer("readers", topic), reader("writers", topic)) == (0, 0)
