"""The last minute of hand, operator and engines, for a page that opens later: a reload, a second device."""

from __future__ import annotations

import math
from collections import deque
from typing import Any

SPAN = 60.0  # s
GAP = 1.5  # s without news, after which nothing is known of the time between
MOST = 1000  # changes


class History:
    """The states of the last minute, at each change; times are those of the scenario [s]."""

    def __init__(self) -> None:
        self._changes: deque[tuple[float, Any]] = deque(maxlen=MOST)
        self._noted = -math.inf

    def note(self, time: float, moment: dict[str, Any]) -> None:
        if time < self._noted:  # of another scenario
            self._changes.clear()
        elif time - self._noted > GAP and self._changes:
            self._changes.append((self._noted, None))
        self._noted = time
        if not self._changes or self._changes[-1][1] != moment:
            self._changes.append((time, moment))
        # The change before the span shows what was shown at its begin.
        while len(self._changes) > 1 and self._changes[1][0] < time - SPAN:
            self._changes.popleft()

    def changes(self) -> list[tuple[float, Any]]:
        """Return times and what was shown from then on; ``None`` where that is not known."""
        return list(self._changes)
