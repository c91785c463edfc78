"""Signals from samples: what holds between them, and what holds when they fall silent.

Meaning: of the samples that were not refused, let a be the last one at or before a time t, and b the first
one after t; their times are tₐ and t_b. The signal at t follows from them, not from the order of arrival.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

from reactivex import Observable

from reactive_node.signals.answers import CERTAIN, EXTRAPOLATED, HELD, UNKNOWN, Refused
from reactive_node.signals.run import Run
from reactive_node.signals.signal import Signal
from reactive_node.signals.source import SECOND, Source, nanoseconds
from reactive_node.signals.values import between
from reactive_node.stamps import Timestamp

T = TypeVar("T")

Between = Callable[[T, T, float], T]
"""From two samples and a ratio, 0 at the first and 1 at the second, to the value between them."""
OnRefused = Callable[[Refused], None]
_FEW = 64  # samples that are not worth a clean-up


class Silence:
    """What holds when the next sample is more than the gap after the last one, or has not come by then."""


@dataclass(frozen=True)
class Nothing(Silence):
    """The value is unknown."""


@dataclass(frozen=True)
class Unchanged(Silence):
    """The last value holds: the topic of a state is silent while nothing changes.

    It is held in the first gap of the silence, in which a change may still go on, and in the last one before
    the next sample, in which the next change began. In between it is certain. So a publisher that changes
    something may pause for twice the gap, and its last value is not taken for a rest.
    """


@dataclass(frozen=True)
class Held(Silence):
    """The last value holds, marked as held."""


@dataclass(frozen=True)
class Extrapolated(Silence):
    """The movement of the last two samples goes on, marked as extrapolated; after the bound it is unknown."""

    bound: float
    """How long after the last sample [s]."""


def hold(
    samples: Observable[Timestamp[T]], *, lateness: float, refused: OnRefused | None = None
) -> Signal[T]:
    """Return the last value: ``hold(samples)(t) = a``.

    It is certain as soon as a sample at t would be late: silence means that nothing has changed.

    :param samples: values with the times of their measurement, in any order. Of two with one time, the first
        that arrives counts.
    :param lateness: how long after its time a sample may arrive [s]. A later one is refused; but if it is
        the newest of all, its value counts from ``lateness`` ago on.
    :param refused: called with each sample that was outside of these bounds.
    """
    bound = nanoseconds("the lateness", lateness)
    return Signal(lambda run: _Held(run, samples, bound, refused))


def linear(
    samples: Observable[Timestamp[T]],
    *,
    lateness: float,
    gap: float,
    silence: Silence = Nothing(),
    refused: OnRefused | None = None,
) -> Signal[T]:
    """Return straight lines: ``linear(samples)(t) = a + (b - a) · (t - tₐ) / (t_b - tₐ)``.

    Values are numbers, tuples of such values, or have ``+``, ``-`` and ``*``. See :func:`interpolate`.
    """
    return interpolate(between, samples, lateness=lateness, gap=gap, silence=silence, refused=refused)


def slerp(
    samples: Observable[Timestamp[tuple[float, float, float, float]]],
    *,
    lateness: float,
    gap: float,
    silence: Silence = Nothing(),
    refused: OnRefused | None = None,
) -> Signal[tuple[float, float, float, float]]:
    """Return rotations at constant speed, the short way: ``a · (a⁻¹ · b)^((t - tₐ) / (t_b - tₐ))``.

    Values are unit quaternions x, y, z, w. See :func:`interpolate`.
    """
    return interpolate(
        rotation_between, samples, lateness=lateness, gap=gap, silence=silence, refused=refused
    )


def interpolate(
    between: Between[T],
    samples: Observable[Timestamp[T]],
    *,
    lateness: float,
    gap: float,
    silence: Silence = Nothing(),
    refused: OnRefused | None = None,
) -> Signal[T]:
    """Return the values between the samples: ``between(a, b, (t - tₐ) / (t_b - tₐ))``.

    This holds where b comes at most a gap after a; the ``silence`` says what holds elsewhere. A value is
    known ``lateness`` after t_b, when no sample can come before b; in silence ``lateness + gap`` after t.

    :param between: the interpolation. For :class:`Extrapolated`, ratios are larger than 1.
    :param samples: values with the times of their measurement, in any order. Of two with one time, the first
        that arrives counts.
    :param lateness: how long after its time a sample may arrive [s]. A later one is refused; but if it is
        the newest of all and silence means :class:`Unchanged`, its value counts as soon as no other sample
        has come for two gaps. One that comes within a gap after that is as late.
    :param gap: the longest time between two samples of one movement [s].
    :param refused: called with each sample that was outside of these bounds.
    """
    bound, longest = nanoseconds("the lateness", lateness), nanoseconds("the gap", gap)
    return Signal(lambda run: _Interpolated(run, samples, bound, refused, between, longest, silence))


def rotation_between(
    a: tuple[float, float, float, float], b: tuple[float, float, float, float], ratio: float
) -> tuple[float, float, float, float]:
    """Return the rotation between two: see :func:`slerp`."""
    cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    if cosine < 0:  # b and -b are the same rotation
        b, cosine = (-b[0], -b[1], -b[2], -b[3]), -cosine
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    if sine < 1e-9:
        return a
    angle = math.atan2(sine, cosine)
    p, q = math.sin((1 - ratio) * angle) / sine, math.sin(ratio * angle) / sine
    return p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2], p * a[3] + q * b[3]


class _Held(Source):
    """Evaluates :func:`hold`; keeps the samples that answers may need."""

    def __init__(self, run: Run, samples: Observable[Any], lateness: int, refused: OnRefused | None) -> None:
        super().__init__(samples, now=run.now, advance=run.advance, lateness=lateness, refused=refused)
        self._times: list[int] = []
        self._values: list[Any] = []
        run.add(self)

    def __len__(self) -> int:
        """How many samples it keeps."""
        return len(self._times)

    def take(self, time: int, value: Any) -> None:
        if self._times and time <= self._times[-1]:
            self.refuse(Refused(time, value, "another sample has the same time"))
        else:
            self._times.append(time)
            self._values.append(value)

    def take_late(self, late: Refused) -> None:
        taken = max([self.settled, *self._times[-1:]]) + 1
        self.take(taken, late.value)
        self.refuse(late._replace(taken=taken))

    def forget(self, time: int) -> None:
        unused = bisect_right(self._times, time) - 2  # one for `a`, one before it for an extrapolation
        if unused > _FEW:
            del self._times[:unused]
            del self._values[:unused]

    def restart(self, now: int) -> None:
        super().restart(now)
        self._times.clear()
        self._values.clear()
        if self.newest is not None:  # a state does not come again
            self._times.append(self.settled)
            self._values.append(self.newest.value)

    def at(self, time: int) -> tuple[Any, int]:
        index = bisect_right(self._times, time) - 1
        return (self._values[index], CERTAIN) if index >= 0 else (None, UNKNOWN)


class _Interpolated(_Held):
    def __init__(
        self,
        run: Run,
        samples: Observable[Any],
        lateness: int,
        refused: OnRefused | None,
        between: Between[Any],
        gap: int,
        silence: Silence,
    ) -> None:
        super().__init__(run, samples, lateness, refused)
        self._between = between
        self._gap = gap
        self._silence = silence
        self._late: Refused | None = None
        """The newest sample, which came too late, until it is known that the state rests."""
        self._shifted: tuple[int, bool] | None = None
        """The time from which the last late value counts [ns], and whether it was the first sample."""
        self.wait += self._gap

    def take(self, time: int, value: Any) -> None:
        self._drop_late()
        shifted = self._shifted
        if shifted is not None and time <= shifted[0] + self._gap:
            self.take_late(Refused(time, value, "it comes right after a late one", is_first=shifted[1]))
        else:
            super().take(time, value)

    def take_late(self, late: Refused) -> None:
        self._drop_late()
        if isinstance(self._silence, Unchanged):
            self._late = late
        else:
            self.refuse(late)

    def settle(self, now: int) -> int:
        before, settled = self.settled, super().settle(now)
        if self._late is not None:
            rest = max([before, *(last + 2 * self._gap for last in self._times[-1:])])
            if settled >= rest:
                super().take(rest + 1, self._late.value)
                self.refuse(self._late._replace(taken=rest + 1))
                self._late, self._shifted = None, (rest + 1, self._late.is_first)
        if not self._times:
            return settled
        last = self._times[-1]
        if isinstance(self._silence, Unchanged):
            return max(last, settled - self._gap)
        return settled if settled >= last + self._gap else last

    def _drop_late(self) -> None:
        """Drop the late value: there is a newer one."""
        if self._late is not None:
            self.refuse(self._late)
            self._late = None

    def restart(self, now: int) -> None:
        self._drop_late()
        self._shifted = None
        super().restart(now)
        if not isinstance(self._silence, Unchanged):
            self._times.clear()
            self._values.clear()

    def at(self, time: int) -> tuple[Any, int]:
        times, values = self._times, self._values
        index = bisect_right(times, time) - 1
        if index < 0:
            return None, UNKNOWN
        begin, value = times[index], values[index]
        if begin == time:
            return value, CERTAIN
        end = times[index + 1] if index + 1 < len(times) else None
        if end is not None and end - begin <= self._gap:
            return self._between(value, values[index + 1], (time - begin) / (end - begin)), CERTAIN
        silence = self._silence
        if isinstance(silence, Unchanged):
            rests = time >= begin + self._gap and (end is None or time < end - self._gap)
            return value, CERTAIN if rests else HELD
        if isinstance(silence, Held):
            return value, HELD
        if isinstance(silence, Extrapolated) and index > 0 and time - begin <= silence.bound * SECOND:
            before = times[index - 1]
            if begin - before <= self._gap:
                ratio = (time - before) / (begin - before)
                return self._between(values[index - 1], value, ratio), EXTRAPOLATED
        return None, UNKNOWN
