"""What a checker found."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

HOLDS, VIOLATED, UNKNOWN = "holds", "VIOLATED", "unknown"


class Evidence(NamedTuple):
    """A violation: when, and what was seen."""

    time: float
    what: str


@dataclass(frozen=True)
class Finding:
    """The verdict on one promise. What the record cannot tell is neither kept nor broken, but unknown."""

    promise: str
    """S1 to S5, L1 to L4"""
    cases: int
    """how often the promise was put to the test, with an outcome"""
    figures: str
    """how near it came to its bound"""
    evidence: Sequence[Evidence] = ()
    unknown: int = 0
    """tests whose outcome the record does not tell"""
    times: dict[str, list[float]] = field(default_factory=dict)
    """durations [s] by program, where the promise is about durations"""

    @property
    def verdict(self) -> str:
        """Whether it holds."""
        return VIOLATED if self.evidence else HOLDS if self.cases else UNKNOWN


def percentile(values: Sequence[float], percent: float) -> float:
    """The nearest-rank percentile; NaN of nothing."""
    if not values:
        return math.nan
    return sorted(values)[max(0, math.ceil(percent / 100 * len(values)) - 1)]
