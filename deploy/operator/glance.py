"""What the engines do and who holds the switch, for a command that looks once."""

from __future__ import annotations

import time
from typing import Any

from deploy.operator.engines import Engines
from deploy.operator.holder import BEATING, Holder
from interfaces import cause, topics
from interfaces.service.reading import observe, unreported
from interfaces.topics import Topic
from reactive_node import ReactiveNode, stamps
from reactive_node.stamps import Timestamp


class Glance:
    """Listens on a node from now on."""

    def __init__(self, node: ReactiveNode) -> None:
        self.engines, self.holder = Engines(), Holder()
        self._since = time.monotonic()

        def listen(topic: Topic, hear: Any) -> None:
            observe(node, topic, unreported, timestamped=True).subscribe(hear, scheduler=node.scheduler)

        listen(topics.ENGINES_STATE, self._state)
        listen(topics.ENGINES_CAUSE, self._cause)
        listen(topics.OPERATOR_HEARTBEAT, self._beat)
        listen(topics.OPERATOR_HAND, self._hand)

    @property
    def is_complete(self) -> bool:
        """Whether all has been heard that is sent repeatedly, or to a new subscriber."""
        is_heard = self.holder.reported or time.monotonic() - self._since > 2 * BEATING
        return bool(is_heard and self.engines.known)

    @property
    def words(self) -> str:
        now = time.monotonic()
        return f"{self.engines.words(now)}\n{self.holder.words(now)}"

    def _state(self, message: Timestamp[str]) -> None:
        self.engines = self.engines.reports(message.value, time.monotonic())

    def _cause(self, message: Timestamp[Any]) -> None:
        age = (stamps.now() - message.timestamp).total_seconds()
        self.engines = self.engines.explains(cause.read(message.value), time.monotonic() - age)

    def _beat(self, _: Timestamp[bool]) -> None:
        self.holder = self.holder.beats(time.monotonic())

    def _hand(self, message: Timestamp[Any]) -> None:
        self.holder = self.holder.reports(message.value.frame_id, time.monotonic())
