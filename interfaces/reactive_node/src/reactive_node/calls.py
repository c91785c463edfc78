"""Service calls that wait for a server without blocking."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable, Disposable

_SERVER_POLL = 0.05  # [s]: ROS has no event for a server that appears
_STEADY = Clock(clock_type=ClockType.STEADY_TIME)


def server_ready(node: Node, is_ready: Callable[[], bool], scheduler: abc.SchedulerBase) -> Observable[None]:
    """Emit while there is a server. It asks in real time, even while ROS time is simulated."""

    def subscribe(observer: abc.ObserverBase[None], _: abc.SchedulerBase | None = None) -> abc.DisposableBase:
        def poll() -> None:
            if is_ready():
                observer.on_next(None)

        timer = node.create_timer(_SERVER_POLL, poll, clock=_STEADY)

        def end() -> None:
            node.destroy_timer(timer)

        return CompositeDisposable(scheduler.schedule(lambda *_: poll()), Disposable(end))

    return Observable(subscribe)


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
