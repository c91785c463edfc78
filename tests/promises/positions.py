"""Which positions follow from the values that were published (S4, L3)."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from interfaces import topics
from interfaces.limits import LARGEST
from tests.promises.effects import DISCOVERY, LONGEST_PAUSE, MISSED, Effect, Reason, undisturbed
from tests.promises.history import SOURCES, History, Sample, last_sent

ROUNDING = 1e-8  # m
PRECISION = 4e-15  # of the lengths, 18 times the precision of float64: the rounding of links beyond 1000 km


class PublishedValues:
    """The values of the configuration, and the positions that follow from them."""

    def __init__(self, history: History) -> None:
        # A service drops a value with a problem, and keeps the one before it.
        good = [
            [s for s in history.stream(topic) if not topic.problem(s.value)]
            for topic in topics.CONFIGURATION.values()
        ]
        self._streams = [([s.sent for s in stream], [s.value for s in stream]) for stream in good]

    def explain(self, position: Sample, within: float) -> bool:
        """Return whether a position follows from values that were the latest within ``within`` [s] before."""
        # The newest values nearly always explain it; older ones are tried only if they do not.
        for window in (0.05, 0.3, 2.0, LONGEST_PAUSE):
            candidates = [
                self._candidates(*stream, position.sent, min(window, within)) for stream in self._streams
            ]
            if _any_fits(candidates, *position.value):
                return True
            if window >= within:
                break
        return False

    @staticmethod
    def _candidates(
        sent: Sequence[float], values: Sequence[float], time: float, window: float
    ) -> list[float]:
        """Return the values that were the latest at some moment of the window, newest first."""
        newest, oldest = bisect_right(sent, time + 0.005), bisect_right(sent, time - window)
        return [*reversed(values[max(0, oldest - 1) : newest])]


def may_lack_values(history: History, found: Sequence[Effect], time: float) -> bool:
    """Return whether the record may lack values that kinematics had received before a time."""
    for source in SOURCES:
        newest = last_sent(history.output(source), time)
        seen = newest.sent if newest else -math.inf
        missed = not undisturbed(found, source, time - DISCOVERY, time, *MISSED, Reason.UNDISCOVERED)
        # What a source sends while it is killed may reach kinematics only.
        if missed or not undisturbed(found, source, seen, time, Reason.CUT_OFF):
            return True
    return False


def _any_fits(candidates: list[list[float]], x: float, y: float) -> bool:
    """Return whether any combination of the values gives the position, up to rounding."""
    if not (abs(x) <= LARGEST and abs(y) <= LARGEST):  # this refuses NaN
        return False
    l1s, l2s, theta1s, theta2s = candidates
    l2s = sorted(l2s)
    for theta1, l1 in itertools.product(theta1s, l1s):
        # The rest has to fit the second link in length before angles are tried.
        rest_x, rest_y = x - l1 * math.cos(theta1), y - l1 * math.sin(theta1)
        length = math.hypot(rest_x, rest_y)
        rounding = max(ROUNDING, PRECISION * l1 + PRECISION * length)
        for l2 in l2s[bisect_left(l2s, length - rounding) : bisect_right(l2s, length + rounding)]:
            for heading in (theta1 + theta2 for theta2 in theta2s):
                error_x, error_y = rest_x - l2 * math.cos(heading), rest_y - l2 * math.sin(heading)
                if abs(error_x) < rounding and abs(error_y) < rounding:
                    return True
    return False
