"""The checker of S6: a pure function from a history to a finding.

A joint that differs between two samples has moved at some time between them. So it has certainly moved too
late if the first of the two was late: the promise allows one sample more than S1. And it has jumped, whenever
that was, if it went further than its scenario moves it, as between the times of two drives.
"""

from __future__ import annotations

import itertools
import math
from bisect import bisect_left
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import Any

from interfaces import topics
from interfaces.service.health import BY_HAND, FASTEST
from tests.promises import claims
from tests.promises.effects import MISSED, Effect, disturbing
from tests.promises.findings import Evidence, Finding
from tests.promises.history import SWITCH, History, Sample, between, gaps

WINDOW = 1.0  # s in which the path of a joint is measured
AT_ONCE = topics.DRIVE_TIMEOUT + 0.2
"""s of its track that a joint may play at once: driven times that have waited, and a step of the drive."""


def joints_stand_in_time(history: History, found: Sequence[Effect]) -> Finding:
    """S6: with a drive, no joint jumps, or moves later than S1 allows after the last sign of life."""
    allowed = history.reaction.off_within
    evidence = [jump for joint in topics.JOINTS for jump in _jumps(history, joint)]
    evidence += claims.driven_time_never_goes_back(history)
    evidence += claims.drive_runs_by_a_young_on(history, found)
    cases, unknown, longest = 0, 0, 0.0
    alive = [s.sent for s in history.signs_of_life()] if history.stream(topics.DRIVEN_TIME) else []
    for begin, end in gaps(alive, -math.inf, history.end) if alive else ():
        if end - begin <= allowed:
            continue
        moves = [move for joint in topics.JOINTS for move in _moves(history, joint, begin, end)]
        if not moves:
            continue
        last = max(before for before, _ in moves)
        blind = disturbing(found, SWITCH, begin, last, *MISSED)
        since = max([begin, *(each.end for each in blind)])
        if since == -math.inf:
            evidence.append(Evidence(last, "a joint moved before the operator's first sign of life"))
        elif last - since > allowed:
            text = f"a joint still moved {last - since:.2f} s after the operator's last sign of life"
            seen = min(after for before, after in moves if before - since > allowed)
            evidence.append(Evidence(seen, text))
        elif last - begin > allowed:
            unknown += 1  # the observer may have missed the last sign of life
            continue
        longest = max(longest, last - since)
        cases += 1
    measured = f"joints stood within {longest:.2f} s, allowed {allowed:g} s"
    return Finding("S6", cases, measured, sorted(evidence), unknown, worst=longest)


def _jumps(history: History, joint: topics.Topic) -> Iterator[Evidence]:
    """Yield when a joint that follows a drive went further in a window than its scenario moves it."""
    reports = _reports(history, joint)
    steps = [(one, two) for one, two in itertools.pairwise(history.stream(joint)) if one.value != two.value]
    times = [two.sent for _, two in steps]
    found = -math.inf
    for last, time in enumerate(times):
        if time < found + WINDOW:
            continue
        first = bisect_left(times, time - WINDOW)
        begin = steps[first][0].sent
        path = sum(abs(two.value - one.value) for one, two in steps[first : last + 1])
        fastest = max(report.get(FASTEST, math.inf) for report in _around(reports, begin, time))
        allowed = fastest * (time - begin + AT_ONCE)
        if path > allowed:
            found = time
            moved = f"{path:.2f} rad in {time - begin:.2f} s, at most {allowed:.2f} is right"
            yield Evidence(time, f"{joint.name} jumped: {moved}")


def _reports(history: History, joint: topics.Topic) -> list[Sample]:
    """Return the reports of health of the source of a joint."""
    return history.health(joint.publishers[0])


def _around(reports: list[Sample], begin: float, end: float) -> list[dict[str, Any]]:
    """Return what was reported of the movement from before a time to after another one.

    ``{}`` stands for a report that is missing.
    """
    first = bisect_left(reports, begin, key=attrgetter("sent")) - 1
    last = bisect_left(reports, end, key=attrgetter("sent"))
    known = [dict(each.value[2:]) for each in reports[max(first, 0) : last + 1]]
    return [*known, {}] if first < 0 or last == len(reports) else known


def _moves(history: History, joint: topics.Topic, begin: float, end: float) -> list[tuple[float, float]]:
    """Return the times of the samples before and after each move of a joint between two times.

    A joint that was set by hand has not moved.
    """
    reports = _reports(history, joint)
    samples = itertools.pairwise(between(history.stream(joint), begin, end))
    return [
        (one.sent, two.sent)
        for one, two in samples
        if one.value != two.value and not _by_hand(reports, two.sent)
    ]


def follows_the_drive(history: History, time: float) -> bool:
    """Return whether a joint may follow the drive at a time: not all of them are set by hand."""
    return not all(_by_hand(_reports(history, joint), time) for joint in topics.JOINTS)


def _by_hand(reports: list[Sample], time: float) -> bool:
    return any(BY_HAND in report for report in _around(reports, time, time))
