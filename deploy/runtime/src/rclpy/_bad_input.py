"""Malformed samples are dropped, counted, and logged once for each writer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy._dds import Sample

if TYPE_CHECKING:
    from rclpy.impl.rcutils_logger import RcutilsLogger

# Bounds the memory: short-lived writers can come without end.
_REMEMBERED_WRITERS = 1000


class BadInput:
    def __init__(self, logger: RcutilsLogger, name: str) -> None:
        self._logger = logger
        self._name = name
        self._writers: set[int] = set()
        self.count = 0

    def drop(self, sample: Sample, reason: Exception) -> None:
        """Count a malformed sample; log the first of each writer."""
        self.count += 1
        if sample.publication_handle in self._writers:
            return
        if len(self._writers) >= _REMEMBERED_WRITERS:
            self._writers.clear()
        self._writers.add(sample.publication_handle)
        self._logger.warning(
            f"dropped a malformed message of {len(sample.data)} octets on {self._name}: {reason}"
            " (others of this writer are dropped silently)"
        )
