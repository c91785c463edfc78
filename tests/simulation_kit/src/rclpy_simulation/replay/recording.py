"""The output of a replay: what programs publish, as an MCAP file of ROS 2 messages."""

from __future__ import annotations

from collections.abc import Callable, Container
from pathlib import Path

from mcap.writer import CompressionType
from mcap_files import rosbag2
from rclpy.topic_or_service_is_hidden import topic_or_service_is_hidden

from rclpy_ground.interface import Sample, user_data_value
from rclpy_simulation.endpoints import Writer
from rclpy_simulation.process import Process

OF_ALL_NODES = ("/rosout", "/parameter_events")
"""Topics that each node publishes. Log messages name files of the machine: they would differ elsewhere."""


class Recording:
    """An MCAP file with the messages of some processes. The same messages make the same octets."""

    def __init__(
        self,
        path: Path,
        processes: Container[Process] | None,
        time_of: Callable[[int], int],
        begin: int = 0,
        left_out: Container[str] = OF_ALL_NODES,
    ) -> None:
        """Create the file when :meth:`complete` is called; until then it has another name.

        :param processes: whose messages are recorded; ``None`` for all.
        :param time_of: converts a time of the monotonic clock to a log time [ns].
        :param begin: the first log time [ns]. Latched messages of before are recorded at it, others not.
        :raises OSError: if it cannot be created.
        """
        self.topics: dict[str, int] = {}
        """How many messages were recorded, by topic."""
        self._path = path
        self._new = path.with_name(f".{path.name}.new")
        self._new.unlink(missing_ok=True)
        self._writer = rosbag2.TopicWriter(self._new, "rclpy-simulation", compression=CompressionType.NONE)
        self._processes = processes
        self._time_of = time_of
        self._begin = begin
        self._left_out = left_out
        self._channels: dict[str, int | None] = {}

    def note(self, writer: Writer, sample: Sample) -> None:
        """Record a message that is about to be sent: a listener of :meth:`Simulation.tap`."""
        if self._processes is not None and writer.participant.process not in self._processes:
            return
        name = writer.topic
        if name not in self._channels:
            self._channels[name] = self._add(writer)
        channel = self._channels[name]
        time = self._time_of(writer.participant.kernel.now)
        if channel is not None and (time >= self._begin or writer.is_latched):
            self._writer.add_message(channel, max(time, self._begin), sample.data, max(time, 0))
            self.topics[name[2:]] += 1

    def _add(self, writer: Writer) -> int | None:
        name = writer.topic[2:]
        if not writer.topic.startswith("rt/") or topic_or_service_is_hidden(name) or name in self._left_out:
            return None
        self.topics[name] = 0
        type_name = writer.type_name.replace("::dds_::", "/").replace("::", "/").removesuffix("_")
        type_hash = user_data_value(writer.user_data, "typehash")
        return self._writer.add_topic(rosbag2.Topic(name, type_name, [writer.info.profile], type_hash))

    def complete(self) -> None:
        """Complete the file. Raises OSError."""
        self._writer.close()
        self._new.replace(self._path)

    def discard(self) -> None:
        """Remove a file that is not complete."""
        self._writer.abandon()
        self._new.unlink(missing_ok=True)
