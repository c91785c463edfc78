"""Services that a recipe answers."""

from __future__ import annotations

from typing import Any

from rclpy.node import Node
from rclpy.task import Future
from reactivex import abc
from reactivex.subject import Subject


class Requests:
    """The requests of a service as items, until each is answered."""

    def __init__(self, node: Node, srv_type: Any, srv_name: str, scheduler: abc.SchedulerBase) -> None:
        self.observable: Subject[Any] = Subject()
        self._node = node
        self._srv_type = srv_type
        self._name = srv_name
        self._scheduler = scheduler
        self._unanswered: dict[int, tuple[Any, Future]] = {}  # by identity: equal requests are different ones
        self._closed = False

    async def serve(self, request: Any, _: Any) -> Any:
        """Emit a request and return its response when there is one: the callback of the service."""
        future = Future()
        self._unanswered[id(request)] = request, future
        # The service's callback group lets callbacks run in parallel; the scheduler's actions run in turn.
        self._scheduler.schedule(lambda *_: self.observable.on_next(request))
        response = await future
        if self._closed:
            await Future()  # forever: rclpy would answer through the destroyed service, and raise
        return response

    def answer(self, answer: Any) -> None:
        """Answer a request, given in a pair with its response.

        :raises TypeError: if it is no such pair.
        :raises ValueError: unless the request waits.
        """
        match answer:
            case (request, response) if isinstance(response, self._srv_type.Response):
                pass
            case _:
                pair = f"pairs of a request and its {self._srv_type.__name__}.Response"
                raise TypeError(f"the recipe of {self._name} must emit {pair}, not {answer!r}")
        _, future = self._unanswered.pop(id(request), (None, None))
        if future is None:
            raise ValueError(f"the recipe of {self._name} answered a request that does not wait: {request!r}")
        future.set_result(response)
        executor = self._node.executor
        if executor is not None:  # the recipe may emit on another thread
            executor.wake()

    def close(self) -> None:
        self._closed = True
