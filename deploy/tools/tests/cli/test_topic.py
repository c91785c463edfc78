from __future__ import annotations

import re
import signal
from typing import Any

import pytest
from deploy.ground.tests.host import wait_until
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, Header, String

HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def test_list_shows_topics_with_types_and_counts(lab: Any, ros2: Any) -> None:
    listed = "/arm/chatter\n/arm/point\n/arm/speed\n/parameter_events\n/rosout\n"
    assert ros2("topic", "list", "--no-daemon").stdout == listed
    assert ros2("topic", "list", "-c", "--no-daemon").stdout == "5\n"
    typed = ros2("topic", "list", "-t", "--include-hidden-topics", "--no-daemon").stdout.splitlines()
    assert typed[0] == "/arm/_hidden [std_msgs/msg/Float64]"
    assert "/arm/point [geometry_msgs/msg/PointStamped]" in typed


def test_verbose_list_has_publishers_and_subscribers(lab: Any, ros2: Any) -> None:
    published, subscribed, _ = ros2("topic", "list", "-v", "--no-daemon").stdout.split("\n\n")
    assert published.startswith("Published topics:\n * /arm/chatter [std_msgs/msg/String] 1 publisher\n")
    assert re.search(r" \* /rosout \[rcl_interfaces/msg/Log\] \d publishers$", published)
    assert subscribed == "Subscribed topics:\n * /arm/speed [std_msgs/msg/Float64] 1 subscriber"


def test_info_counts_endpoints(lab: Any, ros2: Any) -> None:
    done = ros2("topic", "info", "/arm/chatter", "--no-daemon")
    assert done.stdout == "Type: std_msgs/msg/String\nPublisher count: 1\nSubscription count: 0\n"
    assert done.returncode == 0


def test_verbose_info_describes_endpoints(lab: Any, ros2: Any) -> None:
    out = ros2("topic", "info", "-v", "/arm/chatter", "--no-daemon").stdout
    out = out.replace("UNKNOWN", "KEEP_LAST (10)")  # Fast DDS does not announce the history
    assert re.sub(r"GID: [0-9a-f.]+", "GID: X", out) == (
        "Type: std_msgs/msg/String\n\nPublisher count: 1\n\n"
        "Node name: lab\nNode namespace: /arm\nTopic type: std_msgs/msg/String\n"
        f"Topic type hash: {HASH}\n"
        "Endpoint type: PUBLISHER\nGID: X\nQoS profile:\n  Reliability: RELIABLE\n"
        "  History (Depth): KEEP_LAST (10)\n  Durability: VOLATILE\n  Lifespan: Infinite\n"
        "  Deadline: Infinite\n  Liveliness: AUTOMATIC\n  Liveliness lease duration: Infinite\n\n"
        "Subscription count: 0\n\n"
    )


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (
            [],
            "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: base\n"
            "point:\n  x: 0.0\n  y: 0.0\n  z: 0.0\n---\n",
        ),
        (["--csv"], "0,0,base,0.0,0.0,0.0\n"),
        (["--field", "header.frame_id"], "base\n---\n"),
        (["--field", "point"], "x: 0.0\ny: 0.0\nz: 0.0\n---\n"),
        (["--no-str", "--csv"], "0,0,<string length: <4>>,0.0,0.0,0.0\n"),
        (["-l", "2", "--csv"], "0,0,ba...,0.0,0.0,0.0\n"),
        (["-l", "2", "-f", "--csv"], "0,0,base,0.0,0.0,0.0\n"),
        (["--filter", "m.x < 1", "--field", "point", "--csv"], "0.0,0.0,0.0\n"),
    ],
)
def test_echo_gets_the_latched_message_in_the_chosen_form(
    lab: Any, ros2: Any, options: list[str], text: str
) -> None:
    done = ros2("topic", "echo", "/arm/point", "--once", "--no-daemon", *options)
    assert (done.stdout, done.returncode) == (text, 0)


def test_echo_shows_the_message_info_first(lab: Any, ros2: Any) -> None:
    out = ros2("topic", "echo", "/arm/point", "--once", "--no-daemon", "-i", "--field", "point").stdout
    assert re.fullmatch(
        r"publication_sequence_number: \S+\nreceived_timestamp: \d+\nreception_sequence_number: \S+\n"
        r"source_timestamp: \d+\n---\nx: 0.0\ny: 0.0\nz: 0.0\n---\n",
        out,
    )


def test_raw_echo_prints_the_bytes(lab: Any, ros2: Any) -> None:
    out = ros2("topic", "echo", "/arm/chatter", "--once", "--raw", "--no-daemon").stdout
    assert out == "b'\\x00\\x01\\x00\\x00\\x06\\x00\\x00\\x00hello\\x00\\x00\\x00'\n---\n"


def test_echo_ends_after_its_timeout(lab: Any, ros2: Any) -> None:
    done = ros2("topic", "echo", "/arm/speed", "--timeout", "0.2", "--no-daemon")
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)


def test_echo_matches_reliable_and_best_effort_publishers(lab: Any, ros2: Any) -> None:
    best_effort = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    publishers = [lab.create_publisher(String, "mixed", qos) for qos in (best_effort, 10)]
    timer = lab.create_timer(0.05, lambda: publishers[0].publish(String(data="weak")))
    try:
        out = ros2("topic", "echo", "/arm/mixed", "--once", "--no-daemon").stdout
    finally:
        lab.destroy_timer(timer)
        for publisher in publishers:
            lab.destroy_publisher(publisher)
    assert out == (
        "Some, but not all, publishers are offering QoSReliabilityPolicy.RELIABLE. Falling back to "
        "QoSReliabilityPolicy.BEST_EFFORT as it will connect to all publishers\ndata: weak\n---\n"
    )


def test_hz_prints_the_rate_and_its_spread(lab: Any, start: Any) -> None:
    process = start("topic", "hz", "/arm/chatter")
    lines = [process.stdout.readline() for _ in range(4)]
    process.send_signal(signal.SIGINT)
    first = re.fullmatch(r"average rate: (\d+\.\d{3})\n", lines[0])
    assert first
    assert 10.0 < float(first[1]) < 25.0
    spread = r"\tmin: \d\.\d{3}s max: \d\.\d{3}s std dev: \d\.\d{5}s window: (\d+)\n"
    windows = [re.fullmatch(spread, line) for line in (lines[1], lines[3])]
    assert windows[0]
    assert windows[1]
    assert int(windows[0][1]) < int(windows[1][1])
    assert process.wait(10) == 2


def test_bw_prints_the_bandwidth_and_the_sizes(lab: Any, start: Any) -> None:
    process = start("topic", "bw", "/arm/chatter", "-w", "10")
    assert process.stdout.readline() == "Subscribed to [/arm/chatter]\n"
    assert re.fullmatch(r"\d+ B/s from \d+ messages\n", process.stdout.readline())
    assert process.stdout.readline() == "\tMessage size mean: 16 B min: 16 B max: 16 B\n"
    assert re.fullmatch(r"\d+ B/s from 10 messages\n", process.stdout.readline())


def test_hz_waits_for_its_topic(lab: Any, start: Any) -> None:
    process = start("topic", "hz", "/arm/later")
    assert process.stdout.readline() == "WARNING: topic [/arm/later] does not appear to be published yet\n"
    publisher = lab.create_publisher(String, "later", 10)
    timer = lab.create_timer(0.05, lambda: publisher.publish(String()))
    assert process.stdout.readline().startswith("average rate: ")
    lab.destroy_timer(timer)
    lab.destroy_publisher(publisher)


def test_pub_once_waits_for_a_subscription(lab: Any, ros2: Any) -> None:
    received: list[float] = []
    subscription = lab.create_subscription(Float64, "given", lambda m: received.append(m.data), 10)
    done = ros2("topic", "pub", "--once", "/arm/given", "std_msgs/Float64", "data: 1")
    waiting, _, rest = done.stdout.partition("publisher: beginning loop\n")
    assert waiting in ("", "Waiting for at least 1 matching subscription(s)...\n")
    assert rest == "publishing #1: std_msgs.msg.Float64(data=1.0)\n\n"
    wait_until(lambda: received == [1.0])
    lab.destroy_subscription(subscription)


@pytest.mark.own  # that of ROS 2 reads PyYAML's dialect
@pytest.mark.parametrize(
    ("type_", "values", "shown"),
    [
        ("std_msgs/String", "data: y", "String(data='y')"),
        ("std_msgs/String", "data: 1:30", "String(data='1:30')"),
        ("std_msgs/String", "data: 010", "String(data='010')"),
        ("std_msgs/Bool", "data: n", "Bool(data=False)"),
        ("std_msgs/Float64", "data: 1e5", "Float64(data=100000.0)"),
        ("std_msgs/Float64", "data: .inf", "Float64(data=inf)"),
        ("std_msgs/UInt64", "data: 18446744073709551615", "UInt64(data=18446744073709551615)"),
        ("std_msgs/Int32", "data: 0x10", "Int32(data=16)"),
        ("std_msgs/Header", "frame_id: on", "frame_id='on')"),
        (
            "sensor_msgs/JointState",
            "{name: [y, 1e5], position: [1, 2e0]}",
            "name=['y', '1e5'], position=",
        ),
    ],
)
def test_pub_reads_a_value_by_the_type_of_its_field(ros2: Any, type_: str, values: str, shown: str) -> None:
    assert shown in ros2("topic", "pub", "-1", "-w", "0", "/x", type_, values).stdout


def test_pub_repeats_and_sets_the_stamp(lab: Any, ros2: Any) -> None:
    stamps: list[int] = []
    subscription = lab.create_subscription(Header, "stamps", lambda m: stamps.append(m.stamp.sec), 10)
    out = ros2(
        *("topic", "pub", "-t", "4", "-r", "20", "-p", "2", "/arm/stamps", "std_msgs/msg/Header"),
        "{stamp: now, frame_id: base}",
    ).stdout
    lab.destroy_subscription(subscription)
    assert re.findall(r"publishing #(\d)", out) == ["2", "4"]
    assert "frame_id='base'" in out
    assert len(stamps) == 4
    assert min(stamps) > 1_000_000_000


def test_pub_reads_values_from_standard_input(ros2: Any) -> None:
    done = ros2("topic", "pub", "-1", "-w", "0", "/x", "std_msgs/String", "--stdin", input="data: text\n")
    assert "publishing #1: std_msgs.msg.String(data='text')\n" in done.stdout
