"""The DDS reader that all observers of an observable share."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.node import Node
from rclpy.subscription import Subscription
from reactivex import abc
from reactivex.disposable import CompositeDisposable, Disposable

from reactive_node.end import End


class SharedReader:
    """Creates a DDS reader for the first observer and destroys it after the last one."""

    # While there is a reader:
    _listening: tuple[abc.ObserverBase[Any], ...]
    """Members that have got the retained items. Replaced, never changed: the callback takes no lock."""

    def __init__(
        self,
        node: Node,
        create: Callable[..., Subscription],
        *,
        scheduler: abc.SchedulerBase,
        end: End,
        item: Callable[[Any], Any] | None = None,
        retained: deque[Any] | None = None,
    ) -> None:
        """Share a reader among observers; none exists yet.

        :param create: creates the reader of ``node``, with a callback that gets what it receives.
        :param scheduler: runs actions on the thread that runs the callback.
        :param end: completes when the node ends; the observers complete with it.
        :param item: turns what is received into an item, or into ``None`` for none. What it raises is an
            error of the observers.
        :param retained: holds the items for late observers; None if late observers get none.
        """
        self._node = node
        self._create = create
        self._scheduler = scheduler
        self._end = end
        self._item = item
        self._retained = retained
        self._lock = threading.RLock()
        self._subscriptions: list[Subscription] = []
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
            if len(self._members) == 1:
                self._listening = (observer,)
                try:
                    self._begin(scheduler)
                except Exception:
                    self._members = []
                    raise
            elif self._retained is None:
                self._listening += (observer,)
            else:  # on the callback's thread: no message slips between the retained ones and the next
                self._scheduler.schedule(lambda *_: self._join(observer))
        at_end = self._end.subscribe(on_completed=observer.on_completed)
        return CompositeDisposable(at_end, Disposable(lambda: self._leave(observer)))

    def _begin(self, scheduler: abc.SchedulerBase | None) -> None:
        """Create the reader. :param scheduler: that of the first observer."""
        self._subscriptions.append(self._create(self._receive))

    def _finish(self) -> None:
        subscriptions, self._subscriptions = self._subscriptions, []
        if self._retained is not None:
            self._retained.clear()
        for subscription in subscriptions:
            self._node.destroy_subscription(subscription)

    def _join(self, observer: abc.ObserverBase[Any]) -> None:
        with self._lock:
            if observer not in self._members:
                return
            self._listening += (observer,)
            # DDS drops the retained samples of a publisher that has gone.
            alive = any(each.get_publisher_count() > 0 for each in self._subscriptions)
            retained = tuple(self._retained) if self._retained and alive else ()
        for item in retained:
            observer.on_next(item)

    def _receive(self, item: Any) -> None:
        """Hand on what is received. All in one step: every message takes this path."""
        if self._item is not None:
            try:
                item = self._item(item)
            except Exception as error:
                for observer in self._listening:
                    observer.on_error(error)
                return
            if item is None:
                return
        if self._retained is not None:
            self._retained.append(item)
        for observer in self._listening:
            observer.on_next(item)

    def _leave(self, observer: abc.ObserverBase[Any]) -> None:
        with self._lock:
            self._members = [member for member in self._members if member is not observer]
            self._listening = tuple(member for member in self._listening if member is not observer)
            if not self._members:
                self._finish()
