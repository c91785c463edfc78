"""`ros2 bag record`, `info` and `play`: bags that ROS 2's tools and Foxglove read."""

from __future__ import annotations

import importlib.util
import re
import resource
import signal
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest
import yaml
from click.testing import CliRunner
from deploy.runtime.tests.host import wait_until
from deploy.tools.tests.cli.conftest import TIMEOUT
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from geometry_msgs.msg import PointStamped
from mcap_files import FileWriter, McapFile
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from ros2cli import rosbag2
from ros2cli.bag_writer import BagWriter
from ros2cli.commands.bag_info import info
from ros2cli.commands.bag_play import play
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

pytestmark = pytest.mark.own  # ROS 2's is C++; its bags have the same format

Record = Callable[..., Path]


@pytest.fixture
def record(lab: Any, start: Any, tmp_path: Path) -> Record:
    """Records topics until the file has data for a while, and returns the bag."""

    def record(*arguments: str, number: signal.Signals = signal.SIGINT, seconds: float = 1.0) -> Path:
        bag = tmp_path / "bag"
        process = start("bag", "record", "-o", str(bag), *arguments)
        while "Subscribed to topic '/arm/chatter'" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(seconds)  # the length of the record; no result depends on it
        process.send_signal(number)
        assert process.stderr.read().endswith("[rosbag2_recorder]: Recording stopped\n")
        assert process.wait(30) == 0
        return bag

    return record


def test_other_readers_understand_a_bag(record: Record) -> None:
    bag = record("-a")
    with AnyReader([bag]) as reader:
        messages = [
            (connection.topic, reader.deserialize(data, connection.msgtype))
            for connection, _, data in reader.messages()
        ]
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
    (point,) = [message for topic, message in messages if topic == "/arm/point"]
    assert point.header.frame_id == "base"
    assert {message.data for topic, message in messages if topic == "/arm/chatter"} == {"hello"}
    assert counts["/arm/chatter"] >= 10
    assert "/arm/_hidden" not in counts


def test_file_has_the_profile_ros2_with_schemas_and_qos(record: Record) -> None:
    bag = record("/arm/point", "/arm/chatter", number=signal.SIGTERM)
    with (bag / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        (metadata,) = reader.iter_metadata()
    assert summary is not None
    channels = {channel.topic: channel for channel in summary.channels.values()}
    assert channels.keys() == {"/arm/point", "/arm/chatter"}
    channel = channels["/arm/point"]
    assert channel.message_encoding == "cdr"
    (offered,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
    assert (offered["durability"], offered["reliability"]) == ("transient_local", "reliable")
    assert offered["deadline"] == {"sec": 9223372036, "nsec": 854775807}
    assert channel.metadata["topic_type_hash"].startswith("RIHS01_")
    schema = summary.schemas[channel.schema_id]
    assert (schema.name, schema.encoding) == ("geometry_msgs/msg/PointStamped", "ros2msg")
    delimiters = re.findall(r"^={80}\nMSG: (\S+)$", schema.data.decode(), re.MULTILINE)
    assert delimiters == ["geometry_msgs/Point", "std_msgs/Header", "builtin_interfaces/Time"]
    assert metadata.name == "rosbag2"
    written = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert yaml.safe_load(metadata.metadata["serialized_metadata"]) == written
    assert (written["version"], written["storage_identifier"]) == (9, "mcap")


def test_type_without_a_definition_file_is_unknown() -> None:
    from ros2cli.bag_writer import definition

    assert definition("std_srvs/srv/SetBool_Request") == ("unknown", "")
    assert definition("nothing/msg/Nothing") == ("unknown", "")


def test_info_describes_a_bag_and_a_file(record: Record, ros2: Any) -> None:
    bag = record("--topics", "/arm/chatter", "/arm/point", "--storage-preset-profile", "zstd_fast")
    out = ros2("bag", "info", str(bag)).stdout
    date = r"[A-Z][a-z]{2} [ \d]\d \d{4} \d\d:\d\d:\d\d\.\d{9} \(\d{10}\.\d{9}\)"
    indent = " " * 19
    assert re.fullmatch(
        r"\nFiles:             bag_0\.mcap\nBag size:          \d+\.\d KiB\n"
        r"Storage id:        mcap\nROS Distro:        jazzy\nDuration:          \d+\.\d{9}s\n"
        rf"Start:             {date}\nEnd:               {date}\nMessages:          \d+\n"
        r"Topic information: Topic: /arm/chatter \| Type: std_msgs/msg/String \| Count: \d+"
        r" \| Serialization Format: cdr\n"
        rf"{indent}Topic: /arm/point \| Type: geometry_msgs/msg/PointStamped \| Count: 1"
        r" \| Serialization Format: cdr\n"
        r"Service:           0\nService information: \n\n",
        out,
    )
    assert ros2("bag", "info", "-t", str(bag)).stdout == "/arm/chatter\n/arm/point\n"
    of_file = ros2("bag", "info", str(bag / "bag_0.mcap")).stdout
    assert of_file == out.replace("jazzy", "unknown")


def test_filters_select_topics(record: Record, ros2: Any) -> None:
    bag = record("-e", "/arm/", "--exclude-regex", "poi", "--include-unpublished-topics", seconds=0.3)
    assert ros2("bag", "info", "-t", str(bag)).stdout == "/arm/chatter\n/arm/speed\n"


def test_play_keeps_the_pace_and_the_qos(lab: Any, record: Record, ros2: Any, tmp_path: Path) -> None:
    bag = record("/arm/chatter", "/arm/point", seconds=2.0)
    # Queues that hold the whole record, and a delay for a late match: a busy machine loses nothing.
    overrides = tmp_path / "qos.yaml"
    overrides.write_text("/arm/chatter: {reliability: reliable, history: keep_all}")
    everything = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=0)
    arrivals: list[float] = []
    points: list[PointStamped] = []
    latched = QoSProfile(
        depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE
    )
    subscriptions = [
        lab.create_subscription(String, "/replay", lambda _: arrivals.append(time.monotonic()), everything),
        lab.create_subscription(PointStamped, "/replayed_point", points.append, latched),
    ]
    done = ros2(
        *("bag", "play", str(bag), "-r", "2.0", "--delay", "3", "--wait-for-all-acked", "0"),
        *("--qos-profile-overrides-path", str(overrides)),
        *("--remap", "/arm/chatter:=/replay", "/arm/point:=/replayed_point"),
    )
    assert (done.stderr, done.returncode) == ("", 0)
    wait_until(lambda: len(points) == 1)
    metadata = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    counts = {t["topic_metadata"]["name"]: t["message_count"] for t in metadata["topics_with_message_count"]}
    wait_until(lambda: len(arrivals) == counts["/arm/chatter"])
    # a message may be late on a busy machine, but none is early: the whole lasts at least half the record
    with (bag / "bag_0.mcap").open("rb") as file:
        logged = [m.log_time for _, _, m in make_reader(file).iter_messages(["/arm/chatter"])]
    assert arrivals[-1] - arrivals[0] > (logged[-1] - logged[0]) / 1e9 / 2.0 - 0.2
    for subscription in subscriptions:
        lab.destroy_subscription(subscription)


def test_play_filters_topics_and_parts(record: Record, start: Any, ros2: Any) -> None:
    bag = record("/arm/chatter", "/arm/point", seconds=2.0)
    began = time.monotonic()
    done = ros2("bag", "play", str(bag), "--exclude-topics", "/arm/chatter")
    assert done.returncode == 0
    echo = start(
        "topic", "echo", "/clock", "rosgraph_msgs/msg/Clock", "--once", "--qos-reliability", "reliable"
    )
    played = start("bag", "play", str(bag), "--loop", "--clock", "100", "--topics", "/arm/chatter")
    assert echo.stdout.readline() == "clock:\n"
    assert echo.stdout.readline().startswith("  sec: ")
    assert played.poll() is None
    played.send_signal(signal.SIGINT)
    assert played.wait(30) == 0
    assert time.monotonic() - began < 60.0


@pytest.mark.timed
def test_killed_recorder_loses_at_most_a_second(lab: Any, start: Any, ros2: Any, tmp_path: Path) -> None:
    random = Random(7)
    for number in range(3):
        bag = tmp_path / f"bag{number}"
        process = start("bag", "record", "-o", str(bag), "/arm/chatter")
        while "Subscribed to topic '/arm/chatter'" not in process.stderr.readline():
            assert process.poll() is None
        time.sleep(random.uniform(1.0, 3.0))
        killed = time.time_ns()
        process.kill()
        process.wait()
        with McapFile(bag / f"{bag.name}_0.mcap") as file:
            assert not file.is_complete
            assert killed - file.end < 10**9
            count = file.counts.total()
        done = ros2("bag", "info", str(bag))
        assert done.returncode == 0
        assert f"Topic: /arm/chatter | Type: std_msgs/msg/String | Count: {count} |" in done.stdout
        assert re.fullmatch(
            rf".*_0\.mcap has no end: its {count} whole messages of .* s are read\n", done.stderr
        )


def test_full_disk_is_one_line_and_leaves_a_bag(lab: Any, start: Any, ros2: Any, tmp_path: Path) -> None:
    """A limit of the size of a file takes the place of the disk's."""
    bag = tmp_path / "bag"

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))

    process = start("bag", "record", "/arm/chatter", "-o", str(bag), preexec_fn=limit)
    _, errors = process.communicate(timeout=60)
    line = rf"\[ERROR\] \[ros2bag\]: {bag}/bag_0.mcap: File too large, [\d.]+ MB are free\. What was"
    assert re.match(line, errors.splitlines()[-1])
    assert "Traceback" not in errors
    assert process.returncode == 1
    assert ros2("bag", "info", "-t", str(bag)).stdout == "/arm/chatter\n"


def played(messages: list[tuple[str, str, bytes]], path: Path) -> Path:
    """Write a file with messages, 0.1 s apart, given with their topics and encodings."""
    writer = FileWriter(path, "test")
    schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data\n")
    channels: dict[tuple[str, str], int] = {}
    for number, (topic, encoding, data) in enumerate(messages):
        if (topic, encoding) not in channels:
            channels[topic, encoding] = writer.register_channel(topic, encoding, schema)
        writer.add_message(channels[topic, encoding], T0 + number * 10**8, data, T0)
    writer.close()
    return path


GOOD = [("/good", "cdr", serialize_message(String(data=str(number)))) for number in range(5)]
T0 = 1_700_000_000_000_000_000
SENDS_ANYTHING = importlib.util.find_spec("rosidl_runtime_embedded") is None
"""Whether rclpy publishes serialized messages without a look at them: Fast DDS does."""


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        ([("/bad", "cdr", b"")], "" if SENDS_ANYTHING else "Failed to publish a message on '/bad': "),
        ([("/bad", "json", b'{"data": 1}')], "its messages are encoded as 'json', not as 'cdr'."),
        ([("/bad", "ros1", b"\1\0\0\0x")], "its messages are encoded as 'ros1', not as 'cdr'."),
    ],
    ids=["empty", "JSON", "ROS 1"],
)
def test_bad_message_does_not_end_a_play(
    lab: Any, ros2: Any, tmp_path: Path, bad: list[Any], reason: str
) -> None:
    got: list[str] = []
    everything = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=0)
    subscription = lab.create_subscription(String, "/good", lambda it: got.append(it.data), everything)
    bag = played([*GOOD[:2], *bad, *GOOD[2:]], tmp_path / "bag.mcap")
    done = ros2("bag", "play", str(bag), "--delay", "1", "--wait-for-all-acked", "0")
    assert done.returncode == 0
    assert reason in done.stderr
    assert done.stderr.count("\n") == bool(reason)
    wait_until(lambda: got == ["0", "1", "2", "3", "4"])
    lab.destroy_subscription(subscription)


@pytest.mark.parametrize(
    "options", ["--start-offset 100", "--playback-until-sec 1", "--start-offset 100 --loop"]
)
def test_options_outside_of_the_bag_play_nothing(ros2: Any, tmp_path: Path, options: str) -> None:
    done = ros2("bag", "play", str(played(GOOD, tmp_path / "bag.mcap")), *options.split())
    assert (done.returncode, done.stderr) == (0, "")


@pytest.fixture
def whole(tmp_path: Path) -> Path:
    """A bag of five messages in one file."""
    writer = BagWriter(tmp_path / "whole", "fastwrite", {"robot": "arm7"})
    write = writer.add_topic(rosbag2.Topic("/good", "std_msgs/msg/String"))
    for _, _, data in GOOD:
        write(data, T0, T0)
    writer.close()
    return tmp_path / "whole"


def cut_file(bag: Path) -> str:
    file = bag / "whole_0.mcap"
    file.write_bytes(file.read_bytes()[:-200])
    return f"{file} has no end: its 5 whole messages of 0.0 s are read\n"


def cut_metadata(bag: Path) -> str:
    file = bag / "metadata.yaml"
    file.write_bytes(file.read_bytes()[:300])
    return f"{file} is damaged: the messages are read without it\n"


def empty_metadata(bag: Path) -> str:
    (bag / "metadata.yaml").write_text("")
    return f"{bag / 'metadata.yaml'} is damaged: the messages are read without it\n"


@pytest.mark.parametrize("damage", [cut_file, cut_metadata, empty_metadata])
def test_what_is_whole_in_a_damaged_bag_is_read(whole: Path, damage: Callable[[Path], str]) -> None:
    remark = damage(whole)
    done = CliRunner().invoke(info, [str(whole)])
    assert (done.exit_code, done.stderr) == (0, remark)
    assert "Topic: /good | Type: std_msgs/msg/String | Count: 5 |" in done.stdout


def test_bag_with_a_folder_or_without_its_file_is_one_line(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "folder" / "x.mcap").mkdir(parents=True)
    (whole / "whole_0.mcap").unlink()
    (whole / "metadata.yaml").write_text("")
    for bag, reason in (
        (tmp_path / "folder", f"{tmp_path}/folder/x.mcap: Is a directory"),
        (whole, f"{whole}/metadata.yaml is damaged"),
        (Path("/dev/null"), "/dev/null is no MCAP file"),
    ):
        done = CliRunner().invoke(info, [str(bag)])
        assert (done.exit_code, done.output) == (1, f"Error: {reason}\n")


@pytest.mark.parametrize("option", ["--start-offset", "--playback-duration", "--rate", "--clock", "--delay"])
@pytest.mark.parametrize("value", ["inf", "nan"])
def test_options_are_finite(option: str, value: str) -> None:
    done = CliRunner().invoke(play, [__file__, option, value])
    assert done.exit_code == 2
    assert f"{option}': {value!r} is not finite." in done.output


def test_clock_begins_after_the_delay_which_comes_once(lab: Any, start: Any, tmp_path: Path) -> None:
    events: list[tuple[str, float, float]] = []

    def note(name: str, value: float) -> None:
        events.append((name, time.monotonic(), value))

    everything = QoSProfile(history=HistoryPolicy.KEEP_ALL, depth=0)
    subscriptions = [
        lab.create_subscription(
            Clock, "/clock", lambda it: note("clock", it.clock.sec + it.clock.nanosec / 1e9), everything
        ),
        lab.create_subscription(String, "/good", lambda it: note("message", float(it.data)), everything),
    ]
    bag = played(GOOD, tmp_path / "bag.mcap")
    process = start("bag", "play", str(bag), "--delay", "2", "--clock", "50", "--loop")

    def starts() -> list[float]:
        return [at for name, at, value in events if name == "message" and value == 0.0]

    wait_until(lambda: len(starts()) == 3, TIMEOUT)
    process.send_signal(signal.SIGINT)
    assert process.wait(30) == 0
    times = [value for name, at, value in events if name == "clock" and at < starts()[1] - 0.05]
    assert times == sorted(times)
    # the length of the bag is 0.4 s; a delay in each round would make it 2.4 s
    assert starts()[2] - starts()[0] < 2.0
    for subscription in subscriptions:
        lab.destroy_subscription(subscription)


def test_missing_bag_and_wrong_expression_are_wrong_arguments(ros2: Any) -> None:
    assert ros2("bag", "info", "/nowhere").returncode == 2
    assert ros2("bag", "record", "-e", "(").returncode == 2
    assert ros2("bag", "record", "--topics").returncode == 2
