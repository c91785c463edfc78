"""The arm's own chain and watchdog without the contract's checks: what the recipes themselves cost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from reactivex import Observable

from deploy.benchmarks.links import chain_services
from interfaces.service import ServiceNode
from interfaces.topics import Topic


class UncheckedNode(ServiceNode):
    """A node of a service that hands all messages on."""

    def observe(
        self,
        topic: Topic,
        *,
        timestamped: bool = False,
        sampled: float | None = None,
        buffered: Observable[Any] | None = None,
        max_age: float | None = None,
    ) -> Observable[Any]:
        """Return all messages of a topic."""
        read_by = {"timestamped": timestamped, "sampled": sampled, "buffered": buffered}
        return self.create_observable(topic.type, topic.name, topic.qos, **read_by)  # type: ignore[arg-type]

    def publish(
        self,
        topic: Topic,
        items: Observable[Any],
        message: Callable[[Any], Any] = lambda item: item,
        *,
        on_demand: bool = False,
    ) -> None:
        """Publish all items on a topic."""
        self.publish_observable(items.map(message), topic.type, topic.name, topic.qos, on_demand=on_demand)


class Connection(chain_services.Connection):
    """A service without checks in the middle."""

    make_service = UncheckedNode
