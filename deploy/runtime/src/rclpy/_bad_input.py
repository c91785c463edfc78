"""Samples that are no message of their type: dropped, counted, and reported once for each writer."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rclpy._dds import Sample

if TYPE_CHECKING:
    from rclpy.impl.rcutils_logger import RcutilsLogger

# Writers come and go; a flood of short-lived ones must not fill the memory.
_REMEMBERED_WRITERS = 1000


class BadInput:
    """What one reader has dropped."""

    def __init__(self, logger: RcutilsLogger, name: str) -> None:
        self._logger = logger
        self._name = name
        self._writers: set[int] = set()
        self.count = 0

    def drop(self, sample: Sample, reason: Exception) -> None:
        """Count a malformed sample; log the first one of its writer."""
        self.count += 1
        if sample.publication_handle in self._writers:
            return
        if len(self._writers) >= _REMEMBERED_WRITERS:
            self._writers.clear()
        self._writers.add(sample.publication_handle)
        self._logger.warning(
            f"dropped {len(sample.data)} octets on {self._name}: {reason}"
            " (more of this writer is dropped silently)"
        )
