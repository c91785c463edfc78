"""The format of ROS 2's bags: a directory with MCAP files.

Sources: rosbag2_storage and rosbag2_storage_mcap of ROS 2 Jazzy, the MCAP specification's profile ``ros2``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ros_yaml
from mcap_files.definition import definition
from mcap_files.reader import McapFile, UnreadableError
from mcap_files.writer import FileWriter

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile


@dataclass
class Topic:
    """A recorded topic, with the QoS that its publishers offered."""

    name: str
    type: str
    offered: list[QoSProfile] = field(default_factory=list)
    type_hash: str = ""
    encoding: str = "cdr"

    def is_service_event(self) -> bool:
        return "/srv/" in self.type and self.type.endswith("_Event") and self.name.endswith("/_service_event")


@dataclass
class Metadata:
    """What a bag contains."""

    directory: Path
    files: list[str]
    topics: list[Topic]
    remarks: list[str] = field(default_factory=list)
    """How much of files without an end can be read."""

    def paths(self) -> list[Path]:
        return [self.directory / file for file in self.files]


def read(path: Path) -> Metadata:
    """Read what a bag, or a single MCAP file, contains. Raises UnreadableError if it is neither.

    The files say all that ``metadata.yaml`` says, even if their recorder did not end in order.
    """
    if not path.is_dir():
        return _of_files(path.parent, [path])
    files = sorted(path.glob("*.mcap*"))
    if not files:
        raise UnreadableError(f"'{path}' has no MCAP file: convert other bags by `ros2 bag convert` of ROS 2")
    return _of_files(path, files)


def _of_files(directory: Path, paths: list[Path]) -> Metadata:
    topics: dict[str, Topic] = {}
    remarks = []
    for path in paths:
        try:
            with McapFile(path) as file:
                remarks += [file.remark] if file.remark else []
                for channel in file.channels.values():
                    topic = topics.setdefault(channel.topic, Topic(channel.topic, file.type_name(channel)))
                    topic.offered = qos_from_yaml(channel.metadata.get("offered_qos_profiles"))
                    topic.type_hash = channel.metadata.get("topic_type_hash", "")
                    topic.encoding = channel.message_encoding
        except OSError as error:
            raise UnreadableError(f"{path}: {error.strerror}") from None
        except (AttributeError, LookupError, TypeError, ValueError) as error:
            raise UnreadableError(f"{path} has a channel with an unknown QoS: {error}") from None
    return Metadata(directory, [path.name for path in paths], list(topics.values()), remarks)


def replayed_qos(topic: Topic) -> tuple[QoSProfile, bool]:
    """Return the QoS for one publisher in place of the recorded ones, and whether it is theirs.

    It is the default if they differ. Middlewares announce no history, so it has at least ten messages.
    """
    from rclpy.qos import HistoryPolicy, QoSProfile

    relevant = ("reliability", "durability", "deadline", "liveliness", "liveliness_lease_duration")
    first, *others = topic.offered or [QoSProfile(depth=10)]
    is_theirs = all(
        getattr(other, policy) == getattr(first, policy) for other in others for policy in relevant
    )
    if not is_theirs:
        first = QoSProfile(depth=10)
    first.history, first.depth = HistoryPolicy.KEEP_LAST, max(10, sum(each.depth for each in topic.offered))
    return first, is_theirs


class TopicWriter(FileWriter):
    """Writes an MCAP file with the definitions and the QoS of its topics."""

    def __init__(self, path: Path, library: str, **options: Any) -> None:
        """Create a file as :class:`FileWriter` does."""
        super().__init__(path, library, **options)
        self._schemas: dict[str, int] = {}

    def add_topic(self, topic: Topic) -> int:
        """Return the channel for the messages of a topic."""
        if topic.type not in self._schemas:
            self._schemas[topic.type] = self.register_schema(topic.type, *definition(topic.type))
        qos = qos_to_yaml(topic.offered)
        metadata = {"offered_qos_profiles": qos, "topic_type_hash": topic.type_hash}
        return self.register_channel(topic.name, topic.encoding, self._schemas[topic.type], metadata)


def qos_to_yaml(profiles: list[QoSProfile]) -> str:
    return ros_yaml.dump([_qos_to_dict(profile) for profile in profiles])


def _qos_to_dict(profile: QoSProfile) -> dict[str, Any]:
    def duration(name: str) -> dict[str, int]:
        seconds, nanoseconds = divmod(getattr(profile, name).nanoseconds, 10**9)
        return {"sec": seconds, "nsec": nanoseconds}

    return {
        "history": profile.history.short_key,
        "depth": profile.depth,
        "reliability": profile.reliability.short_key,
        "durability": profile.durability.short_key,
        "deadline": duration("deadline"),
        "lifespan": duration("lifespan"),
        "liveliness": profile.liveliness.short_key,
        "liveliness_lease_duration": duration("liveliness_lease_duration"),
        "avoid_ros_namespace_conventions": profile.avoid_ros_namespace_conventions,
    }


def qos_from_yaml(profiles: str | list[dict[str, Any]] | None) -> list[QoSProfile]:
    """Return recorded profiles; policies are names, or numbers before version 9. Raises ValueError."""
    parsed = ros_yaml.load(profiles) if isinstance(profiles, str) else profiles
    return [qos_from_dict(profile) for profile in parsed or []]


def qos_from_dict(policies: dict[str, Any]) -> QoSProfile:
    """Return the profile with these policies of a file. Raises ValueError for an unknown policy or value."""
    from rclpy import qos
    from rclpy.duration import Duration

    def duration(value: dict[str, int]) -> Duration:
        return Duration(seconds=value["sec"], nanoseconds=value["nsec"])

    def policy(kind: Any) -> Callable[[str | int], Any]:
        return lambda value: kind(value) if isinstance(value, int) else kind.get_from_short_key(value)

    convert: dict[str, Callable[[Any], Any]] = {
        "history": policy(qos.HistoryPolicy),
        "depth": int,
        "reliability": policy(qos.ReliabilityPolicy),
        "durability": policy(qos.DurabilityPolicy),
        "liveliness": policy(qos.LivelinessPolicy),
        "avoid_ros_namespace_conventions": bool,
        **dict.fromkeys(("deadline", "lifespan", "liveliness_lease_duration"), duration),
    }
    made = {}
    for name, value in policies.items():
        if name not in convert:
            raise ValueError(f"Unexpected key `{name}` for QoS profile.")
        try:
            made[name] = convert[name](value)
        except (AttributeError, LookupError, OverflowError, TypeError, ValueError):
            raise ValueError(f"Unexpected value `{value}` of `{name}` for QoS profile.") from None
    try:
        return qos.QoSProfile(**made)
    except qos.InvalidQoSProfileException as error:
        raise ValueError(str(error)) from None
