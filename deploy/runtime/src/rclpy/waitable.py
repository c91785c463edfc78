"""Waitables: what an executor waits for, besides subscriptions, timers, services and guard conditions."""

from __future__ import annotations

from types import TracebackType
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.task import Future


class NumberOfEntities:
    """Numbers of entities that a waitable adds to a wait set."""

    def __init__(
        self,
        num_subs: int = 0,
        num_gcs: int = 0,
        num_timers: int = 0,
        num_clients: int = 0,
        num_services: int = 0,
        num_events: int = 0,
    ) -> None:
        self.num_subscriptions = num_subs
        self.num_guard_conditions = num_gcs
        self.num_timers = num_timers
        self.num_clients = num_clients
        self.num_services = num_services
        self.num_events = num_events

    def __add__(self, other: NumberOfEntities) -> NumberOfEntities:
        mine, others = vars(self), vars(other)
        total = NumberOfEntities()
        vars(total).update({kind: mine[kind] + others[kind] for kind in mine})
        return total

    def __repr__(self) -> str:
        return f"<NumberOfEntities({', '.join(map(str, vars(self).values()))})>"


class Waitable:
    """Base class of what :meth:`rclpy.node.Node.add_waitable` adds to a node.

    Before each wait, the executor calls :meth:`add_to_wait_set`. If :meth:`is_ready` afterwards, it calls
    :meth:`take_data`, and runs :meth:`execute` with the result. The wait set accepts the handles of guard
    conditions, timers, subscriptions and services.
    """

    def __init__(self, callback_group: CallbackGroup) -> None:
        self.callback_group: CallbackGroup | None = callback_group
        self._futures: list[Future] = []
        callback_group.add_entity(self)

    def __enter__(self) -> None:
        """Do nothing: the destruction of an entity in use is safe."""

    def __exit__(
        self, t: type[BaseException] | None, v: BaseException | None, tb: TracebackType | None
    ) -> None:
        """Do nothing."""

    def add_future(self, future: Future) -> None:
        """Let the executor that runs the waitable run the done callbacks of a future."""
        self._futures.append(future)

    def remove_future(self, future: Future) -> None:
        """Undo :meth:`add_future`. Raises ValueError if the future was not added."""
        self._futures.remove(future)

    def is_ready(self, wait_set: Any) -> bool:
        """Return whether the waitable has work, after a wait; implemented by subclasses."""
        raise NotImplementedError("Must be implemented by subclass")

    def take_data(self) -> Any:
        raise NotImplementedError("Must be implemented by subclass")

    async def execute(self, taken_data: Any) -> None:
        raise NotImplementedError("Must be implemented by subclass")

    def get_num_entities(self) -> NumberOfEntities:
        """Return how many entities :meth:`add_to_wait_set` adds."""
        raise NotImplementedError("Must be implemented by subclass")

    def add_to_wait_set(self, wait_set: Any) -> None:
        raise NotImplementedError("Must be implemented by subclass")
