"""Bags of MCAP files: what is read of them, and what their topics are written with."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from mcap.reader import make_reader
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from mcap_files import UnreadableError, rosbag2
from mcap_files.definition import definition

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def write(path: Path, topic: rosbag2.Topic) -> Path:
    path.parent.mkdir(exist_ok=True)
    writer = rosbag2.TopicWriter(path, "test")
    writer.add_message(writer.add_topic(topic), 0, serialize_message(String(data="x")), 0)
    writer.close()
    return path


def test_topic_has_its_definition_its_qos_and_its_hash(tmp_path: Path) -> None:
    topic = rosbag2.Topic("/point", "geometry_msgs/msg/PointStamped", [LATCHED], "RIHS01_0")
    with write(tmp_path / "x.mcap", topic).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    (channel,), (schema,) = summary.channels.values(), summary.schemas.values()
    assert (channel.topic, channel.message_encoding) == ("/point", "cdr")
    (offered,) = yaml.safe_load(channel.metadata["offered_qos_profiles"])
    assert (offered["durability"], offered["reliability"]) == ("transient_local", "reliable")
    assert offered["deadline"] == {"sec": 0, "nsec": 0}
    assert channel.metadata["topic_type_hash"] == "RIHS01_0"
    assert (schema.name, schema.encoding) == ("geometry_msgs/msg/PointStamped", "ros2msg")
    delimiters = re.findall(r"^={80}\nMSG: (\S+)$", schema.data.decode(), re.MULTILINE)
    assert delimiters == ["geometry_msgs/Point", "std_msgs/Header", "builtin_interfaces/Time"]


@pytest.mark.parametrize("name", ["std_srvs/srv/SetBool_Request", "nothing/msg/Nothing"])
def test_type_without_a_definition_file_is_unknown(name: str) -> None:
    assert definition(name) == ("unknown", b"")


def test_files_of_a_bag_are_read_as_one(tmp_path: Path) -> None:
    write(tmp_path / "bag" / "bag_0.mcap", rosbag2.Topic("/a", "std_msgs/msg/String", [LATCHED]))
    cut = write(tmp_path / "bag" / "bag_1.mcap", rosbag2.Topic("/b", "std_msgs/msg/String"))
    cut.write_bytes(cut.read_bytes()[:-200])
    (tmp_path / "bag" / "metadata.yaml").write_text("of no use")
    bag = rosbag2.read(tmp_path / "bag")
    assert [(topic.name, topic.offered) for topic in bag.topics] == [("/a", [LATCHED]), ("/b", [])]
    assert bag.remarks == [f"{cut} has no end: its 1 whole messages of 0.0 s are read"]
    assert bag.paths() == [tmp_path / "bag" / "bag_0.mcap", cut]


@pytest.mark.parametrize("text", ["[{depth: .inf}]", "[{reliability: [x]}]", "[{nothing: 1}]"])
def test_channel_with_an_unknown_qos_is_an_error(tmp_path: Path, text: str) -> None:
    path = tmp_path / "x.mcap"
    writer = rosbag2.FileWriter(path, "test")
    writer.register_channel("/x", "cdr", 0, {"offered_qos_profiles": text})
    writer.close()
    with pytest.raises(UnreadableError, match="has a channel with an unknown QoS"):
        rosbag2.read(path)


def test_folder_without_a_file_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UnreadableError, match="has no MCAP file"):
        rosbag2.read(tmp_path)
    (tmp_path / "x.mcap").mkdir()
    with pytest.raises(UnreadableError, match=r"x\.mcap: Is a directory"):
        rosbag2.read(tmp_path)
