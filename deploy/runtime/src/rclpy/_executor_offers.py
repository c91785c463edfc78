"""The part of an executor that offers its work to a user's class: ``wait_for_ready_callbacks``."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from types import CoroutineType
from typing import TYPE_CHECKING, Any, cast

from rclpy._executor_entities import ExecutorEntities
from rclpy.task import Task

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node

Offer = tuple[Task, Any, "Node | None"]
"""A task, with its entity and node; without them, one of ``create_task()``."""


class ExecutorOffers(ExecutorEntities):
    """The callbacks that a user's class has been offered as tasks, until they are done."""

    def __init__(self) -> None:
        super().__init__()
        self._rclpy_offers: dict[Task, tuple[Any, Node | None]] = {}  # not done, with what else was returned
        self._rclpy_offers_changed = False
        self._rclpy_round: deque[Task] | None = None  # those to return before the next wait

    def _rclpy_next_offer(self, nodes: list[Node] | None) -> Offer | None:
        """Return a task that was returned before, is not done, and can run now; ``None``: wait for others.

        Between two waits, each such task is returned once.
        """
        if self._rclpy_round is None:
            self._rclpy_offers_changed = False  # first: later changes are handled in the next round
            for task in [task for task in self._rclpy_offers if task._rclpy_is_over()]:
                del self._rclpy_offers[task]
            self._rclpy_round = deque(self._rclpy_offers)
        while self._rclpy_round:
            task = self._rclpy_round.popleft()
            entity, node = self._rclpy_offers[task]
            if task._rclpy_can_run() and (nodes is None or node is None or node in nodes):
                return task, entity, node
        self._rclpy_round = None
        return None

    def _rclpy_reserve(self, use: Callable[[Any], None], entity: Any) -> bool:
        """Use a ready task or entity, unless the entity must not run; return whether it was used."""
        if entity.__class__ is not Task:
            if not self.can_execute(entity):
                self._rclpy_block(entity)
                return False
            self._rclpy_reserved.add(entity)
            self._rclpy_detach(entity)
        use(entity)
        return True

    def _rclpy_offer(self, entity: Any, nodes: list[Node]) -> Offer:
        """Return the task of a reserved entity, which runs its callback, or a task of ``create_task()``."""
        task, node = entity, None
        if entity.__class__ is Task:
            entity = None
        else:
            task = Task(self._rclpy_run_reserved, (entity,), executor=cast("Executor", self))
            entity = getattr(entity, "waitable", entity)
            node = next((node for node in nodes if entity in node._rclpy_entities()), None)
        self._rclpy_offers[task] = (entity, node)
        # When the task ends, its callback group may allow other callbacks, for which another thread may wait.
        task._rclpy_call_when_complete(self._rclpy_change_offers)
        return task, entity, node

    async def _rclpy_run_reserved(self, entity: Any) -> None:
        """Run the callback of an entity whose task a user's class has called."""
        group = entity.callback_group
        if group is not None and not group.beginning_execution(entity):
            self._rclpy_release(entity)
            return
        try:
            try:
                taken = entity._rclpy_take()
            finally:
                self._rclpy_release(entity)
            result = None if taken is None else entity._rclpy_execute(taken)
            if result.__class__ is CoroutineType:
                await result
        finally:
            self._rclpy_end_execution(entity)

    def _rclpy_release(self, entity: Any) -> None:
        self._rclpy_reserved.discard(entity)
        self._rclpy_groups_changed = True
        self.wake()

    def _rclpy_change_offers(self) -> None:
        self._rclpy_offers_changed = True
        self.wake()

    def _rclpy_take_back_offers(self) -> None:
        """Run what wait_for_ready_callbacks() has returned, and the user's class has not run to its end."""
        if self._rclpy_offers:
            offers, self._rclpy_offers, self._rclpy_round = self._rclpy_offers, {}, None
            self._tasks.extend(task for task in offers if not task._rclpy_is_over())
