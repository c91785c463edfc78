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

    def observe(self, topic: Topic, *, max_age: float | None = None, **read_by: Any) -> Observable[Any]:
        """Return all messages of a topic."""
        return self.create_observable(topic.type, topic.name, topic.qos, **read_by)

    def publish(
        self,
        topic: Topic,
        items: Observable[Any],
        message: Callable[[Any], Any] = lambda item: item,
        **options: Any,
    ) -> None:
        """Publish all items on a topic."""
        self.publish_observable(items.map(message), topic.type, topic.name, topic.qos, **options)


class Connection(chain_services.Connection):
    """A service without checks in the middle."""

    make_service = UncheckedNode
