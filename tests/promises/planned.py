"""How many cases of a promise the plan of a run makes: its faults, and what the operator's hand does.

Much fewer cases are a failure of the run, for then the promise was not judged, and nothing else shows that: a
switch that never lets go leaves S1 without a case. L1 and L4 make a case of each of their faults, and S4 of
each message.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from operator import itemgetter

from interfaces import topics
from tests.promises.drive import follows_the_drive
from tests.promises.findings import Evidence, Finding, count, how_often
from tests.promises.history import (
    CONTROLLER,
    KINEMATICS,
    SILENCE,
    SOURCES,
    Condition,
    History,
    InjectedFault,
    between,
    running,
)

LEAST = 4  # planned cases of which the number says something
SHARE = 0.5  # of them has to be exercised: other faults hide some
HELD = 10.0  # s for which a hand holds the switch: long enough to turn the engines on
LONGER = 1.0  # s more than S1 allows, for which a silence is a long one
FLOWED = 0.5  # s without a value, after which it is a constant, or the arm stands: then L3 has no case
FLOWING = 3  # streams at least that another program's kill leaves alone
MOMENTARY = ("kill", "terminate", "raise")


def with_planned(finding: Finding, due: int, end: float) -> Finding:
    """Return a finding, with evidence if a run exercised much fewer cases than planned.

    :param due: the number of planned cases.
    :param end: of the record [s].
    """
    found = finding.cases + finding.unknown
    if due < LEAST or found >= SHARE * due:
        return finding
    text = f"the run exercised it {how_often(found)}, and planned {count(due, 'case')}"
    return replace(finding, evidence=[*finding.evidence, Evidence(end, text)])


def planned(history: History) -> dict[str, int]:
    """Return how many cases a run makes, by promise."""
    ran = list(running(history))

    def runs(at: float) -> bool:
        last = bisect_right(ran, at, key=itemgetter(0)) - 1
        return last >= 0 and at <= ran[last][1]

    def flows(fault: InjectedFault) -> bool:
        return bool(between(history.output(fault.target), fault.begin - FLOWED, fault.begin))

    silences = [each for each in history.conditions if each.kind == SILENCE]
    allowed = history.reaction.off_within + LONGER
    long = [each for each in silences if each.end - each.begin > allowed]
    stops = [each.begin for each in long if each.end < history.end and runs(each.begin)]
    kills = [each for each in history.faults if each.kind == "kill"]
    of_values = [each for each in history.faults if each.target in (KINEMATICS, *SOURCES)]
    return {
        "S1": len(stops),
        "S2": sum(
            each.target != CONTROLLER and runs(each.begin) and _is_held(silences, each.begin)
            for each in kills
        ),
        "S3": sum(
            min(two.begin, history.end) - one.end > HELD for one, two in pairwise(silences) if one in long
        ),
        "S5": sum(each.pid > 0 for each in kills),
        "S6": sum(follows_the_drive(history, at) for at in stops if history.stream(topics.DRIVEN_TIME)),
        "L2": FLOWING * len(kills),
        "L3": sum(each.kind in MOMENTARY and flows(each) for each in of_values),
    }


def _is_held(silences: Sequence[Condition], time: float) -> bool:
    """Return whether the operator's hand holds the switch at a time, as far as the plan shows it."""
    return bool(silences) and not any(each.begin <= time < each.end for each in silences)
