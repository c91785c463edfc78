"""The one DDS reader that all observers of an observable share."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.subscription import Subscription
from reactivex import abc
from reactivex.disposable import CompositeDisposable, Disposable

from reactive_node.end import End
from reactive_node.stamps import Timestamp


class SharedReader:
    """Creates a DDS reader for the first observer and destroys it after the last one."""

    # While there is a reader:
    _listening: tuple[abc.ObserverBase[Any], ...]
    """Members that have got the retained samples. Replaced, never changed: _receive takes no lock."""

    def __init__(
        self,
        node: Node,
        create: Callable[[Callable[..., None]], Subscription],
        *,
        scheduler: abc.SchedulerBase,
        end: End,
        retained: deque[Any] | None = None,
        timestamped: bool = False,
    ) -> None:
        """
        Share a reader among observers; none exists yet.

        :param create: creates the reader of ``node`` with a callback.
        :param scheduler: runs actions on the thread that runs the callback.
        :param end: completes when the node ends; the observers complete with it.
        :param retained: holds the samples for late observers; None if late observers get none.
        :param timestamped: whether items are :class:`Timestamp` s instead of messages.
        """
        self._node = node
        self._create = create
        self._scheduler = scheduler
        self._end = end
        self._retained = retained
        self._callback = self._receive_with_info if timestamped else self._receive
        self._lock = threading.RLock()
        self._subscription: Subscription | None = None
        self._members: list[abc.ObserverBase[Any]] = []

    def subscribe(
        self, observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        """Add an observer; safe on any thread."""
        with self._lock:
            if self._end.is_stopped:
                observer.on_completed()
                return Disposable()
            self._members.append(observer)
            if self._subscription is None:
                self._listening = (observer,)
                try:
                    self._subscription = self._create(self._callback)
                except Exception:
                    self._members = []
                    raise
            elif self._retained is None:
                self._listening += (observer,)
            else:  # on the callback's thread: no message slips between the retained ones and the next
                self._scheduler.schedule(lambda *_: self._join(observer))
        at_end = self._end.subscribe(on_completed=observer.on_completed)
        return CompositeDisposable(at_end, Disposable(lambda: self._leave(observer)))

    def _join(self, observer: abc.ObserverBase[Any]) -> None:
        with self._lock:
            if self._subscription is None or observer not in self._members:
                return
            self._listening += (observer,)
            # DDS drops the retained samples of a publisher that has gone.
            alive = self._subscription.get_publisher_count() > 0
            retained = tuple(self._retained) if self._retained and alive else ()
        for item in retained:
            observer.on_next(item)

    def _receive(self, item: Any) -> None:
        if self._retained is not None:
            self._retained.append(item)
        for observer in self._listening:
            observer.on_next(item)

    def _receive_with_info(self, message: Any, info: Any) -> None:
        # Without Timestamp() and _receive(): where messages are rare, each call costs most.
        item: Timestamp[Any] = tuple.__new__(Timestamp, (message, info["source_timestamp"]))
        if self._retained is not None:
            self._retained.append(item)
        for observer in self._listening:
            observer.on_next(item)

    def _leave(self, observer: abc.ObserverBase[Any]) -> None:
        with self._lock:
            self._members = [member for member in self._members if member is not observer]
            self._listening = tuple(member for member in self._listening if member is not observer)
            if self._members or self._subscription is None:
                return
            subscription, self._subscription = self._subscription, None
            if self._retained is not None:
                self._retained.clear()
            self._node.destroy_subscription(subscription)


def retention(qos_profile: QoSProfile | int) -> deque[Any] | None:
    """Return an empty store for the samples that late observers get; None if they get none."""
    if isinstance(qos_profile, int) or qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL:
        return None
    return deque(maxlen=None if qos_profile.history == HistoryPolicy.KEEP_ALL else qos_profile.depth)
