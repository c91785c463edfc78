"""Service calls that wait for a server without blocking."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable, Disposable, SingleAssignmentDisposable

_SERVER_POLL = 0.05  # [s]: ROS has no event for a server that appears
_STEADY = Clock(clock_type=ClockType.STEADY_TIME)


class Servers:
    """Looks for the servers for which calls wait, by one timer for all calls of a node.

    It looks in real time, even while ROS time is simulated. Without a call that waits, there is no timer.
    """

    def __init__(self, node: Node, scheduler: abc.SchedulerBase) -> None:
        self._scheduler = scheduler
        self._lock = threading.RLock()  # any thread may dispose

        def subscribe(
            observer: abc.ObserverBase[None], _: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            timer = node.create_timer(_SERVER_POLL, lambda: observer.on_next(None), clock=_STEADY)
            return Disposable(lambda: node.destroy_timer(timer))

        self._looks: Observable[None] = Observable(subscribe).share()

    def ready(self, is_ready: Callable[[], bool]) -> Observable[None]:
        """Emit when there is a server, at once or later; all that wait for it share each look."""
        later = self._looks.filter(lambda _: is_ready()).share()

        def subscribe(
            observer: abc.ObserverBase[None], _: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            waiting = SingleAssignmentDisposable()

            def look(*_: Any) -> None:
                if is_ready():
                    observer.on_next(None)
                    return
                with self._lock:
                    waiting.disposable = later.subscribe(observer)

            def leave() -> None:
                with self._lock:
                    waiting.dispose()

            return CompositeDisposable(self._scheduler.schedule(look), Disposable(leave))

        return Observable(subscribe).take(1)


def response(client: Client, request: Any, scheduler: abc.SchedulerBase) -> Observable[Any]:
    """Send a request when subscribed; emit the response, or its error."""

    def subscribe(observer: abc.ObserverBase[Any], _: abc.SchedulerBase | None = None) -> abc.DisposableBase:
        def done(future: Future) -> None:
            try:
                result = future.result()
            except Exception as error:
                observer.on_error(error)
            else:
                observer.on_next(result)
                observer.on_completed()

        future = client.call_async(request)
        # A future's callbacks belong to no callback group; the scheduler's actions run in the node's.
        future.add_done_callback(lambda future: scheduler.schedule(lambda *_: done(future)))
        return Disposable(lambda: client.remove_pending_request(future))

    return Observable(subscribe)
