"""The transforms of one frame to its parent, over time. Times are in nanoseconds; 0 means the latest."""

from __future__ import annotations

from bisect import bisect_left, bisect_right

from tf2_py._exceptions import ExtrapolationException
from tf2_py._matrices import Matrix, Quaternion, Vector, matrix_of, slerp


def seconds(stamp: int) -> str:
    """Return a time as text [s]."""
    return f"{stamp / 1e9:.6f}"


class Sample:
    """A received transform from a frame to its parent; ``rotation`` is a unit quaternion."""

    __slots__ = ("_matrix", "parent", "rotation", "stamp", "translation")

    def __init__(self, stamp: int, parent: str, translation: Vector, rotation: Quaternion) -> None:
        self.stamp = stamp
        self.parent = parent
        self.translation = translation
        self.rotation = rotation
        self._matrix: Matrix | None = None

    @property
    def matrix(self) -> Matrix:
        """The transform as a matrix. It is made on the first use: most samples are never looked up."""
        if self._matrix is None:
            self._matrix = matrix_of(self.translation, self.rotation)
        return self._matrix

    def is_same(self, other: Sample) -> bool:
        """Return whether the other sample says the same about the same time."""
        return (
            self.stamp == other.stamp
            and self.parent == other.parent
            and self.translation == other.translation
            and self.rotation == other.rotation
        )


class Interpolation:
    """A transform between two samples with the same parent."""

    __slots__ = ("_newer", "_older", "parent", "stamp")

    def __init__(self, older: Sample, newer: Sample, stamp: int) -> None:
        self._older, self._newer = older, newer
        self.stamp = stamp
        self.parent = older.parent

    @property
    def matrix(self) -> Matrix:
        """The transform as a matrix: linear in the translation, spherical in the rotation."""
        older, newer = self._older, self._newer
        ratio = (self.stamp - older.stamp) / (newer.stamp - older.stamp)
        rest = 1.0 - ratio
        x1, y1, z1 = older.translation
        x2, y2, z2 = newer.translation
        translation = rest * x1 + ratio * x2, rest * y1 + ratio * y2, rest * z1 + ratio * z2
        return matrix_of(translation, slerp(older.rotation, newer.rotation, ratio))


class TimeCache:
    """Samples of the last ``duration`` [ns]."""

    def __init__(self, duration: int) -> None:
        self._duration = duration
        self._stamps: list[int] = []  # ascending
        self._samples: list[Sample] = []

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def latest(self) -> int:
        """The time of the latest sample, 0 without one."""
        return self._stamps[-1] if self._stamps else 0

    @property
    def oldest(self) -> int:
        """The time of the oldest sample, 0 without one."""
        return self._stamps[0] if self._stamps else 0

    def insert(self, sample: Sample) -> bool:
        """Insert a sample, unless it is already there; return ``False`` if it is too old."""
        oldest = self.latest - self._duration
        expired = bisect_left(self._stamps, oldest)
        del self._stamps[:expired], self._samples[:expired]
        if self._stamps and sample.stamp < oldest:
            return False
        end = bisect_right(self._stamps, sample.stamp)
        begin = bisect_left(self._stamps, sample.stamp, 0, end)
        if not any(sample.is_same(other) for other in self._samples[begin:end]):
            self._stamps.insert(end, sample.stamp)
            self._samples.insert(end, sample)
        return True

    def clear(self) -> None:
        self._stamps.clear()
        self._samples.clear()

    def at(self, stamp: int) -> Sample | Interpolation | None:
        """Return the transform at a time, or ``None`` if the latest is wanted and there is none.

        :raises ExtrapolationException: if the time is not between two samples, or at one of them.
        """
        if stamp == 0:
            return self._samples[-1] if self._samples else None
        if not self._stamps:
            raise ExtrapolationException(
                f"Lookup would require extrapolation at time {seconds(stamp)}, "
                "but there is no data in the buffer"
            )
        if stamp == self.latest:
            return self._samples[-1]
        if stamp == self.oldest:
            return self._samples[0]
        if len(self._stamps) == 1:
            raise ExtrapolationException(
                f"Lookup would require extrapolation at time {seconds(stamp)}, "
                f"but only time {seconds(self.latest)} is in the buffer"
            )
        if stamp > self.latest:
            raise ExtrapolationException(
                "Lookup would require extrapolation into the future.  "
                f"Requested time {seconds(stamp)} but the latest data is at time {seconds(self.latest)}"
            )
        if stamp < self.oldest:
            raise ExtrapolationException(
                "Lookup would require extrapolation into the past.  "
                f"Requested time {seconds(stamp)} but the earliest data is at time {seconds(self.oldest)}"
            )
        newer = bisect_right(self._stamps, stamp)
        before, after = self._samples[newer - 1], self._samples[newer]
        if before.stamp == stamp or before.parent != after.parent:
            return before
        return Interpolation(before, after, stamp)


class StaticCache:
    latest = oldest = 0

    def __init__(self) -> None:
        self._sample: Sample | None = None

    def __len__(self) -> int:
        return 1

    def insert(self, sample: Sample) -> bool:
        """Replace the transform. The stamp of a static transform is 0."""
        self._sample = sample
        return True

    def clear(self) -> None:
        """Keep the transform: a static transform does not become outdated."""

    def at(self, stamp: int) -> Sample | None:
        return self._sample
