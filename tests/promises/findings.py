"""The result of a checker: verdict, evidence and measured figures for one promise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

HOLDS, VIOLATED, UNKNOWN = "holds", "VIOLATED", "unknown"


class Evidence(NamedTuple):
    """A violation: its time [s] and a description."""

    time: float
    text: str
    cause: str = ""
    """Who had to act, and did not, as far as the record shows it."""

    @property
    def words(self) -> str:
        return f"{self.text}: {self.cause}" if self.cause else self.text


@dataclass(frozen=True)
class Finding:
    """The result for one promise. A case that the record cannot decide counts as unknown."""

    promise: str
    """S1 to S6, L1 to L4."""
    cases: int
    """How often the promise was exercised and the outcome is known."""
    measured: str
    """The figures, in words."""
    evidence: Sequence[Evidence] = ()
    unknown: int = 0
    """How often the promise was exercised and the record does not show the outcome."""
    times: dict[str, list[float]] = field(default_factory=dict)
    """Durations [s] by program, for a promise about durations."""
    worst: float = -math.inf
    """The longest duration [s], for a promise that limits one and saw one."""

    @property
    def verdict(self) -> str:
        return VIOLATED if self.evidence else HOLDS if self.cases else UNKNOWN

    @property
    def summary(self) -> str:
        if self.verdict != UNKNOWN:
            return self.measured
        return "outcome unknown" if self.unknown else "not exercised"


def overall(findings: Sequence[Finding]) -> str:
    """Return VIOLATED if a promise is violated, HOLDS if none is and one holds, and UNKNOWN otherwise."""
    verdicts = {finding.verdict for finding in findings}
    return next((verdict for verdict in (VIOLATED, HOLDS) if verdict in verdicts), UNKNOWN)


def merged(findings: Sequence[Finding]) -> Finding:
    """Return the findings about one promise in several records as one."""
    times: dict[str, list[float]] = {}
    for finding in findings:
        for program, values in finding.times.items():
            times.setdefault(program, []).extend(values)
    worst = max(findings, key=lambda finding: finding.worst)
    every = [time for values in times.values() for time in values]
    measured = worst.measured if worst.worst > -math.inf else ""
    if worst.promise == "L1" and every:
        p50, p99 = percentile(every, 50), percentile(every, 99)
        measured = f"p50 {p50:.2f} s, p99 {p99:.2f} s, at most {max(every):.2f} s"
    return replace(
        worst,
        cases=sum(finding.cases for finding in findings),
        unknown=sum(finding.unknown for finding in findings),
        evidence=[each for finding in findings for each in finding.evidence],
        measured=measured,
        times=times,
    )


def percentile(values: Sequence[float], percent: float) -> float:
    """Return the nearest-rank percentile; NaN if there are no values."""
    if not values:
        return math.nan
    return sorted(values)[max(0, math.ceil(percent / 100 * len(values)) - 1)]


def count(number: int, noun: str) -> str:
    """Return a number and a noun, in the plural where needed: ``1 fault``, ``2 faults``."""
    plural = "es" if noun.endswith("s") else "s"
    return f"{number} {noun}{'' if number == 1 else plural}"


def how_often(number: int) -> str:
    """Return how often something happened: ``once``, ``2 times``."""
    return "once" if number == 1 else f"{number} times"
