"""The format of ROS 2's bags: a directory with ``metadata.yaml`` (version 9) and MCAP files.

Sources: rosbag2_storage and rosbag2_storage_mcap of ROS 2 Jazzy, the MCAP specification's profile ``ros2``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import yaml

if TYPE_CHECKING:
    from rclpy.qos import QoSProfile

METADATA_FILE = "metadata.yaml"
_DURATIONS = ("deadline", "lifespan", "liveliness_lease_duration")


@dataclass
class Topic:
    """A recorded topic, with the QoS that its publishers offered."""

    name: str
    type: str
    offered: list[QoSProfile] = field(default_factory=list)
    type_hash: str = ""
    count: int = 0
    encoding: str = "cdr"

    def is_service_event(self) -> bool:
        return "/srv/" in self.type and self.type.endswith("_Event") and self.name.endswith("/_service_event")


@dataclass
class Metadata:
    """What ``metadata.yaml`` says about a bag; times [ns]."""

    directory: Path
    files: list[str]
    topics: list[Topic]
    start: int = 0
    duration: int = 0
    storage: str = "mcap"
    ros_distro: str = ""
    custom_data: dict[str, str] = field(default_factory=dict)
    remarks: list[str] = field(default_factory=list)
    """How much of files without an end can be read."""

    @property
    def count(self) -> int:
        return sum(topic.count for topic in self.topics)

    def paths(self) -> list[Path]:
        return [self.directory / file for file in self.files]


def to_yaml(metadata: Metadata) -> str:
    """Return the content of ``metadata.yaml`` below its only key."""

    def extent() -> dict[str, Any]:  # a new one each time: YAML would refer to the first
        return {
            "duration": {"nanoseconds": metadata.duration},
            "starting_time": {"nanoseconds_since_epoch": metadata.start},
            "message_count": metadata.count,
        }

    topics = [
        {
            "topic_metadata": {
                "name": topic.name,
                "type": topic.type,
                "serialization_format": topic.encoding,
                "offered_qos_profiles": [_qos_to_dict(profile) for profile in topic.offered],
                "type_description_hash": topic.type_hash,
            },
            "message_count": topic.count,
        }
        for topic in metadata.topics
    ]
    document = {
        "version": 9,
        "storage_identifier": metadata.storage,
        **extent(),
        "topics_with_message_count": topics,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": metadata.files,
        "files": [{"path": file, **extent()} for file in metadata.files],
        "custom_data": metadata.custom_data,
        "ros_distro": metadata.ros_distro,
    }
    return yaml.safe_dump(document, sort_keys=False)


def write(metadata: Metadata) -> None:
    """Write ``metadata.yaml``, or nothing. Raises OSError."""
    text = to_yaml(metadata).replace("\n", "\n  ").rstrip(" ")
    path = metadata.directory / METADATA_FILE
    try:
        path.write_text(f"rosbag2_bagfile_information:\n  {text}")
    except OSError as error:
        path.unlink(missing_ok=True)
        raise OSError(error.errno, error.strerror, str(path)) from None


def read(path: Path) -> Metadata:
    """Read the metadata of a bag, or of a single MCAP file. Raises ClickException if it is neither."""
    from mcap_files import is_cut

    if not path.is_dir():
        return _of_files(path.parent, [path])
    files = sorted(path.glob("*.mcap*"))
    file = path / METADATA_FILE
    try:
        metadata = _from_dict(path, yaml.safe_load(file.read_text())["rosbag2_bagfile_information"])
    except FileNotFoundError:
        if files:
            return _of_files(path, files)  # the recorder did not end in order
        raise click.ClickException(f"'{path}' is no bag: it has no {METADATA_FILE}") from None
    except (yaml.YAMLError, LookupError, TypeError, ValueError):
        if not files:
            raise click.ClickException(f"{file} is damaged") from None
        metadata = _of_files(path, files)
        metadata.remarks.insert(0, f"{file} is damaged: the messages are read without it")
        return metadata
    if metadata.storage != "mcap":
        raise click.ClickException(
            f"'{path}' is stored as {metadata.storage}, but only mcap is supported: convert it on ROS 2"
            " with `ros2 bag convert`"
        )
    if not any(is_cut(each) for each in metadata.paths() if each.exists()):
        return metadata
    found = _of_files(path, metadata.paths())
    found.ros_distro, found.custom_data = metadata.ros_distro, metadata.custom_data
    return found


def _from_dict(directory: Path, document: dict[str, Any]) -> Metadata:
    return Metadata(
        directory=directory,
        files=[Path(file).name for file in document["relative_file_paths"]],
        topics=[
            Topic(
                name=topic["topic_metadata"]["name"],
                type=topic["topic_metadata"]["type"],
                offered=qos_from_yaml(topic["topic_metadata"].get("offered_qos_profiles")),
                type_hash=topic["topic_metadata"].get("type_description_hash", ""),
                count=topic["message_count"],
                encoding=topic["topic_metadata"]["serialization_format"],
            )
            for topic in document["topics_with_message_count"] or []
        ],
        start=document["starting_time"]["nanoseconds_since_epoch"],
        duration=document["duration"]["nanoseconds"],
        storage=document["storage_identifier"],
        ros_distro=document.get("ros_distro") or "",
        custom_data=document.get("custom_data") or {},
    )


def _of_files(directory: Path, paths: list[Path]) -> Metadata:
    from mcap_files import McapFile, UnreadableError

    topics: dict[str, Topic] = {}
    extents, remarks = [], []
    for path in paths:
        try:
            with McapFile(path) as file:
                remarks += [file.remark] if file.remark else []
                extents += [file.start, file.end] if file.counts else []
                for number, channel in file.channels.items():
                    topic = topics.setdefault(channel.topic, Topic(channel.topic, file.type_name(channel)))
                    topic.offered = qos_from_yaml(channel.metadata.get("offered_qos_profiles"))
                    topic.type_hash = channel.metadata.get("topic_type_hash", "")
                    topic.encoding = channel.message_encoding
                    topic.count += file.counts[number]
        except OSError as error:
            raise click.ClickException(f"{path}: {error.strerror}") from None
        except UnreadableError as error:
            raise click.ClickException(str(error)) from None
        except (AttributeError, LookupError, TypeError, ValueError, yaml.YAMLError) as error:
            raise click.ClickException(f"{path} has a channel with an unknown QoS: {error}") from None
    start, end = min(extents, default=0), max(extents, default=0)
    names = [path.name for path in paths]
    return Metadata(directory, names, list(topics.values()), start, end - start, remarks=remarks)


def qos_to_yaml(profiles: list[QoSProfile]) -> str:
    return yaml.safe_dump([_qos_to_dict(profile) for profile in profiles], sort_keys=False)


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
    parsed = yaml.safe_load(profiles) if isinstance(profiles, str) else profiles
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
        **dict.fromkeys(_DURATIONS, duration),
    }
    made = {}
    for name, value in policies.items():
        if name not in convert:
            raise ValueError(f"Unexpected key `{name}` for QoS profile.")
        try:
            made[name] = convert[name](value)
        except (LookupError, TypeError, ValueError):
            raise ValueError(f"Unexpected value `{value}` of `{name}` for QoS profile.") from None
    try:
        return qos.QoSProfile(**made)
    except qos.InvalidQoSProfileException as error:
        raise ValueError(str(error)) from None


def qos_overrides(path: str | None) -> dict[str, QoSProfile]:
    """Read the profiles in a file for ``--qos-profile-overrides-path``, by topic. Raises ClickException."""
    if path is None:
        return {}
    try:
        document = yaml.safe_load(Path(path).read_text())
        return {topic: qos_from_dict(policies) for topic, policies in document.items()}
    except (OSError, AttributeError, ValueError, yaml.YAMLError) as error:
        raise click.ClickException(f"[ERROR] [ros2bag]: {path}: {error}") from None
