"""Whether more is published on /diagnostics than the sentinel reads, and who publishes it."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Collection

from diagnostic_msgs.msg import DiagnosticArray

from interfaces.topics import DIAGNOSTICS
from reactive_node import ReactiveNode

SHOWN = 5.0  # s for which a loss is a warning
NAMED = 3  # strangers in a report


class Flood:
    def __init__(self, node: ReactiveNode, ours: Collection[str]) -> None:
        """:param ours: the full names of the nodes of the arm."""
        self._node = node
        self._ours = ours
        self._subjects: Counter[str] = Counter()  # of the messages since the last look
        self._is_full = False
        self._lost = -math.inf  # when messages may have been lost [s, monotonic clock]
        self._words = ""

    def hear(self, message: DiagnosticArray) -> None:
        self._subjects.update(status.name for status in message.status[:1])

    def overflow(self) -> None:
        """Note that messages may have been lost."""
        self._is_full = True

    def look(self) -> str:
        """Return that reports of health are lost, and by whom; empty if none were lost lately."""
        if self._is_full:
            self._is_full, self._lost = False, time.monotonic()
            self._words = self._describe()
        self._subjects.clear()
        return self._words if time.monotonic() - self._lost < SHOWN else ""

    def _describe(self) -> str:
        words = "so many messages arrive that reports of health are lost"
        if self._subjects:
            words += f", most of them about {self._subjects.most_common(1)[0][0]!r}"
        if strangers := sorted(self._publishers() - {*self._ours})[:NAMED]:
            words += f"; these nodes are not of the arm: {', '.join(map(repr, strangers))}"
        return words

    def _publishers(self) -> set[str]:
        found = self._node.publishers_of(DIAGNOSTICS.name)
        return {f"{each.namespace.rstrip('/')}/{each.node}" for each in found}
