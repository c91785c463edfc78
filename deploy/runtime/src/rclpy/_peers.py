"""What other participants announce about their nodes."""

from __future__ import annotations

from collections.abc import Callable

from rclpy._bad_input import BadInput
from rclpy._dds import Reader, Sample
from rclpy._dds.discovery import Discovery
from rclpy._discovery_info import TOPIC, NodeEntities, decode
from rclpy.logging import get_logger

_MANY = 100
"""With more participants than these, those that are gone are removed."""


class Peers:
    def __init__(self, reader: Reader) -> None:
        self._reader = reader
        self._announced: dict[bytes, Sample] = {}  # by a participant's GUID; decoded on the first query
        self._nodes: dict[bytes, list[NodeEntities]] = {}
        self._many = _MANY
        self._bad_input = BadInput(get_logger("rclpy"), TOPIC)

    def take(self, discovered: Callable[[], Discovery]) -> None:
        """Keep the latest announcement of each participant that DDS has ``discovered``."""
        while (sample := self._reader.take()) is not None:
            self._announced[sample.data[4:20]] = sample
        if len(self._announced) + len(self._nodes) > self._many:
            self._decode(discovered())
            self._many = max(_MANY, 2 * len(self._nodes))

    def nodes(self, discovered: Callable[[], Discovery]) -> dict[bytes, list[NodeEntities]]:
        """Return the nodes of every participant that exists, by its GUID."""
        self.take(discovered)
        self._decode(discovered())
        return self._nodes

    def _decode(self, discovery: Discovery) -> None:
        """Decode the announcements; keep those of participants that exist."""
        while self._announced:
            sample = self._announced.popitem()[1]
            try:
                gid, nodes = decode(sample.data)
            except ValueError as error:
                self._bad_input.drop(sample, error)
            else:
                self._nodes[gid] = nodes
        present = discovery.participants()
        for gid in [gid for gid in self._nodes if gid not in present]:
            del self._nodes[gid]
