"""The checker of S6: a pure function from a history to a finding.

A joint that differs between two samples has moved at some time between them. So it has certainly moved too
late if the first of the two was late: the promise allows one sample more than S1.
"""

from __future__ import annotations

import itertools
import math

from interfaces import topics
from tests.promises.effects import MISSED, disturbing, effects
from tests.promises.findings import Evidence, Finding
from tests.promises.history import SWITCH, History, between, gaps


def joints_stand_in_time(history: History) -> Finding:
    """S6: with a drive, no joint moves later than S1 allows after the operator's last sign of life."""
    found, allowed = effects(history), history.reaction.off_within
    evidence, cases, unknown, longest = [], 0, 0, 0.0
    alive = [s.sent for s in history.signs_of_life()] if history.stream(topics.DRIVEN_TIME) else []
    for begin, end in gaps(alive, -math.inf, history.end) if alive else ():
        if end - begin <= allowed:
            continue
        last = max(_last_move(history, joint, begin, end) for joint in topics.JOINTS)
        if last == -math.inf:
            continue
        blind = disturbing(found, SWITCH, begin, last, *MISSED)
        since = max([begin, *(min(each.end, last) for each in blind)])
        if since == -math.inf:
            evidence.append(Evidence(last, "a joint moved before the operator's first sign of life"))
        elif last - since > allowed:
            text = f"a joint still moved {last - since:.2f} s after the operator's last sign of life"
            evidence.append(Evidence(since + allowed, text))
        elif last - begin > allowed:
            unknown += 1  # the observer may have missed the last sign of life
            continue
        longest = max(longest, last - since)
        cases += 1
    measured = f"joints stood within {longest:.2f} s, allowed {allowed:g} s"
    return Finding("S6", cases, measured, evidence, unknown, worst=longest)


def _last_move(history: History, joint: topics.Topic, begin: float, end: float) -> float:
    """Return the time of the last sample before a joint moved between two times; -∞ if it stood still."""
    samples = itertools.pairwise(between(history.stream(joint), begin, end))
    return max((one.sent for one, two in samples if one.value != two.value), default=-math.inf)
