"""Writes a bag: one MCAP file with the messages, and the metadata at its end."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from mcap.writer import CompressionType

from mcap_files import FileWriter
from ros2cli import rosbag2
from ros2cli.definition import message_type

_PRESETS: dict[str, dict[str, Any]] = {
    "none": {"compression": CompressionType.NONE},
    "fastwrite": {"compression": CompressionType.NONE, "use_chunking": False},
    "zstd_fast": {"compression": CompressionType.ZSTD},
    "zstd_small": {"compression": CompressionType.ZSTD, "chunk_size": 4 * 1024 * 1024},
}
"""Options of MCAP's writer for rosbag2's storage preset profiles."""


class BagWriter:
    def __init__(self, directory: Path, preset: str, custom_data: dict[str, str]) -> None:
        """Create the directory and its file. Raises OSError."""
        directory.mkdir(parents=True)
        file = f"{directory.name}_0.mcap"
        self._metadata = rosbag2.Metadata(directory, [file], [], custom_data=custom_data)
        self._metadata.ros_distro = "jazzy"
        self._writer = FileWriter(directory / file, "ros2-python-tools", **_PRESETS[preset])
        self._schemas: dict[str, int] = {}

    def add_topic(self, topic: rosbag2.Topic) -> Callable[[bytes, int, int], None]:
        """Return the function that writes a message: its CDR, and times of reception and publishing [ns]."""
        if topic.type not in self._schemas:
            encoding, text = definition(topic.type)
            self._schemas[topic.type] = self._writer.register_schema(topic.type, encoding, text.encode())
        channel = self._writer.register_channel(
            topic.name,
            "cdr",
            self._schemas[topic.type],
            {"offered_qos_profiles": rosbag2.qos_to_yaml(topic.offered), "topic_type_hash": topic.type_hash},
        )
        self._metadata.topics.append(topic)

        def write(data: bytes, received: int, published: int) -> None:
            self._writer.add_message(channel, received, data, published)
            metadata = self._metadata
            end = max(metadata.start + metadata.duration, received)
            metadata.start = min(metadata.start or received, received)
            metadata.duration = end - metadata.start
            topic.count += 1

        return write

    def save(self) -> None:
        """Bring everything so far to the disk. Raises OSError."""
        self._writer.save()

    def close(self) -> None:
        """Complete the file and write the metadata, unless the disk is full. Raises OSError."""
        if self._writer.is_open:
            self._writer.add_metadata("rosbag2", {"serialized_metadata": rosbag2.to_yaml(self._metadata)})
            self._writer.close()
            rosbag2.write(self._metadata)


def definition(type_name: str) -> tuple[str, str]:
    """Return the encoding and the text of the definition of a message, followed by those of its fields.

    Without a definition file, the encoding is ``unknown``, as in rosbag2; parts of services have none.
    """
    from rosidl_runtime_py import get_interface_path

    if "/msg/" not in type_name:
        return "unknown", ""
    seen = {type_name}

    def text(name: str) -> str:
        parts = [Path(get_interface_path(name)).read_text(encoding="utf-8")]
        package = name.partition("/")[0]
        used = {type_ for line in parts[0].splitlines() if (type_ := message_type(line, package))}
        for nested in sorted(used):
            if nested not in seen:
                seen.add(nested)
                parts.append(f"{'=' * 80}\nMSG: {nested.replace('/msg/', '/')}\n{text(nested)}")
        return "\n".join(parts)

    try:
        return "ros2msg", text(type_name)
    except LookupError:  # its package came without the files
        return "unknown", ""
