"""Which positions follow from the values that were published (S4, L3)."""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence

from deploy.promises.history import SOURCES, History, Sample, last_sent
from interfaces import topics

ROUNDING = 1e-8  # m
PRECISION = 4e-15  # of the lengths, 18 times the precision of float64: the rounding of links beyond 1000 km
LONGEST_PAUSE = 20.0  # s for which a process may be suspended, and its values become old
ORDER = 0.1  # s by which the observer may receive a value later than a position that follows from it
SENDING = 0.02  # s between the begin of a fault and a value that its process was sending
DISCOVERY = 1.0  # s from the first message that the observer received until every reader knows the publisher


class PublishedValues:
    """The values of the configuration, and the positions that follow from them."""

    def __init__(self, history: History) -> None:
        # A service drops a value with a problem, and keeps the one before it.
        self._streams = [
            [s for s in history.stream(topic) if not topic.problem(s.value)]
            for topic in topics.CONFIGURATION.values()
        ]

    def explain(self, position: Sample, within: float) -> bool:
        """Return whether a position follows from values that were the latest within ``within`` [s] before."""
        # The newest values nearly always explain it; older ones are tried only if they do not.
        for window in (0.05, 0.3, 2.0, LONGEST_PAUSE):
            candidates = [
                self._candidates(stream, position.sent, min(window, within)) for stream in self._streams
            ]
            if _any_fits(candidates, *position.value):
                return True
            if window >= within:
                break
        return False

    @staticmethod
    def _candidates(stream: Sequence[Sample], time: float, window: float) -> list[float]:
        """Return the values that were the latest at some moment of the window, newest first."""
        newest = bisect_right(stream, time + 0.005, key=lambda s: s.sent)
        oldest = bisect_right(stream, time - window, key=lambda s: s.sent)
        return [s.value for s in reversed(stream[max(0, oldest - 1) : newest])]


def may_have_missed_values(history: History, time: float) -> bool:
    """
    Return whether the record may lack values that a reader received.

    It does before the observer has discovered their publisher, and at its end.
    """
    if history.may_have_missed(time - DISCOVERY, time) or time > history.end - ORDER:
        return True
    for life in history.lives:
        if life.program in SOURCES and life.began < time:
            output = history.output(life.program)
            first = bisect_right(output, life.began, key=lambda s: s.sent)
            if first == len(output) or time < output[first].sent + DISCOVERY:
                return True
    return False


def may_have_reached_only_some(history: History, time: float) -> bool:
    """
    Return whether a value that the record has as the newest one may be missing elsewhere.

    A source sends a value to one reader after the other. A fault may end or suspend it in between.
    """
    newest = {program: last_sent(history.output(program), time) for program in SOURCES}
    return any(
        (value := newest.get(fault.target)) is not None and abs(value.sent - fault.begin) < SENDING
        for fault in history.faults
    )


def _any_fits(candidates: list[list[float]], x: float, y: float) -> bool:
    """Return whether any combination of the values gives the position, up to rounding."""
    if not (math.isfinite(x) and math.isfinite(y)):
        return False
    l1s, l2s, theta1s, theta2s = candidates
    l2s = sorted(l2s)
    for theta1, l1 in itertools.product(theta1s, l1s):
        # The rest has to fit the second link in length before angles are tried.
        rest_x, rest_y = x - l1 * math.cos(theta1), y - l1 * math.sin(theta1)
        length = math.hypot(rest_x, rest_y)
        if not math.isfinite(length):
            continue
        rounding = max(ROUNDING, PRECISION * l1 + PRECISION * length)
        for l2 in l2s[bisect_left(l2s, length - rounding) : bisect_right(l2s, length + rounding)]:
            for heading in (theta1 + theta2 for theta2 in theta2s):
                if math.isinf(heading):  # kinematics has no position for it
                    continue
                error_x, error_y = rest_x - l2 * math.cos(heading), rest_y - l2 * math.sin(heading)
                if abs(error_x) < rounding and abs(error_y) < rounding:
                    return True
    return False
