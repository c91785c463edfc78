"""A DDS reader that is read by the clock: what arrives between two ticks is never taken from DDS."""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.subscription import Subscription
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable, Disposable, SingleAssignmentDisposable

from reactive_node.end import End
from reactive_node.shared_reader import SharedReader
from reactive_node.stamps import Timestamp

BUFFER = 1000  # messages that a reader keeps for a tick that reads all of them


class Polled(CallbackGroup):
    """The group of a reader that is read at ticks: an executor would wake for each message."""

    def can_execute(self, entity: Any) -> bool:
        return False

    def beginning_execution(self, entity: Any) -> bool:
        return False

    def ending_execution(self, entity: Any) -> None:
        """Do nothing."""


def keep_last(qos_profile: QoSProfile | int, count: int) -> QoSProfile:
    """Return a QoS whose reader keeps that many messages."""
    qos = QoSProfile(depth=qos_profile) if isinstance(qos_profile, int) else copy.copy(qos_profile)
    qos.history = HistoryPolicy.KEEP_LAST
    qos.depth = count
    return qos


def sampled_messages(
    node: Node,
    create: Callable[..., Subscription],
    ticks: Observable[Any],
    *,
    timestamped: bool = False,
    most: int = 1,
    on_full: Callable[[], Any] = lambda: None,
) -> Observable[Any]:
    """Return the messages that a reader holds at each tick, those that have come since the tick before.

    :param create: creates the reader of ``node`` with the arguments ``callback_group`` and
        ``event_callbacks``.
    :param timestamped: whether items are :class:`Timestamp` s instead of messages.
    :param most: as many messages as a tick reads.
    :param on_full: is called at each tick that has read that many.
    """

    def subscribe(
        observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        # No QoS events: with Fast DDS, unread messages would end each wait for them at once.
        events = SubscriptionEventCallbacks(use_default_callbacks=False)
        subscription = create(callback_group=Polled(), event_callbacks=events)
        lock = threading.Lock()
        is_live = True

        def take() -> tuple[Any, Any] | None:
            with lock:  # another thread may destroy the reader
                if not is_live:
                    return None
                with subscription.handle:
                    taken: tuple[Any, Any] | None = subscription.handle.take_message(
                        subscription.msg_type, subscription.raw
                    )
                    return taken

        def read(_: Any) -> None:
            for _ in range(most):
                try:
                    taken = take()
                except RuntimeError as error:  # RCLError: the octets are no message of this type
                    node.get_logger().warning(f"{subscription.topic_name}: {error}")
                    continue
                if taken is None:
                    return
                message, info = taken
                if timestamped:  # without Timestamp(), which takes a datetime: it has no nanoseconds
                    message = tuple.__new__(Timestamp, (message, info["source_timestamp"]))
                observer.on_next(message)
            on_full()

        def destroy() -> None:
            nonlocal is_live
            with lock:
                is_live = False
                node.destroy_subscription(subscription)

        reading = ticks.subscribe(read, observer.on_error, observer.on_completed, scheduler=scheduler)
        return CompositeDisposable(reading, Disposable(destroy))

    return Observable(subscribe)


class SampledReader(SharedReader):
    def __init__(
        self,
        node: Node,
        create: Callable[..., Subscription],
        ticks: Observable[Any],
        *,
        scheduler: abc.SchedulerBase,
        end: End,
        timestamped: bool,
        item: Callable[[Any], Any] | None,
        most: int,
        on_full: Callable[[], Any],
    ) -> None:
        """For the parameters see :func:`sampled_messages` and :class:`SharedReader`."""
        super().__init__(node, create, scheduler=scheduler, end=end, item=item)
        self._messages = sampled_messages(
            node, create, ticks, timestamped=timestamped, most=most, on_full=on_full
        )

    def _begin(self, scheduler: abc.SchedulerBase | None) -> None:
        reading = self._reading = SingleAssignmentDisposable()  # the ticks may end while it begins
        reading.disposable = self._messages.subscribe(
            self._receive, self._fail, self._complete, scheduler=scheduler
        )

    def _finish(self) -> None:
        self._reading.dispose()

    def _fail(self, error: Exception) -> None:
        for observer in self._dismissed():
            observer.on_error(error)

    def _complete(self) -> None:
        for observer in self._dismissed():
            observer.on_completed()

    def _dismissed(self) -> tuple[abc.ObserverBase[Any], ...]:
        """Forget all observers and return them: one that subscribes again at the end begins to read."""
        with self._lock:
            observers, self._listening, self._members = self._listening, (), []
        return observers
