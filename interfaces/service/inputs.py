"""The messages of a topic as an observer of a service gets them: only the good ones, each once."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from datetime import datetime
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable

from interfaces.topics import Topic
from reactive_node import Timestamp

_RECENT = 16  # messages of which a second reader may deliver a copy


class Input:
    """Reads the samples of a topic for one observer; drops and reports bad ones."""

    def __init__(
        self,
        topic: Topic,
        observer: abc.ObserverBase[Any],
        *,
        drop: Callable[[str, str], None],
        staleness: Callable[[datetime], str] | None,
        timestamped: bool,
        item: Callable[[Any], Any] | None,
    ) -> None:
        """
        Make an input without readers.

        :param drop: called with the topic's name and the reason for each message that is not good.
        :param staleness: returns why a source time is not fresh, empty if it is; None if all are.
        :param timestamped: whether items are :class:`Timestamp` s instead of messages.
        :param item: turns each message or Timestamp into the item that the observer gets; None if it gets
            them unchanged.
        """
        self._topic = topic
        self._observer = observer
        self._drop = drop
        self._staleness = staleness
        self._timestamped = timestamped
        self._item = item
        self._recent: deque[int] | None = None  # source times, while two readers may get the same message

    def read(self, samples: Observable[Timestamp[bytes]]) -> abc.DisposableBase:
        """Read the samples of a reader until the result is disposed."""
        return samples.subscribe(self._read, self._observer.on_error, self._observer.on_completed)

    def read_every_publisher(self, create: Callable[..., Observable[Timestamp[bytes]]]) -> abc.DisposableBase:
        """
        Read the samples of a latched topic, also those of publishers that are not latched.

        A transient-local reader receives nothing from a volatile publisher, such as ``ros2 topic pub``; if
        there is one, a volatile reader listens as well.

        :param create: creates a reader with a QoS and event callbacks.
        """
        readers = CompositeDisposable()

        def add_volatile(_: Any) -> None:
            if self._recent is None:
                self._recent = deque(maxlen=_RECENT)
                qos = QoSProfile(depth=self._topic.qos.depth, durability=DurabilityPolicy.VOLATILE)
                readers.add(self.read(create(qos)))

        events = SubscriptionEventCallbacks(incompatible_qos=add_volatile)
        readers.add(self.read(create(self._topic.qos, event_callbacks=events)))
        return readers

    def _read(self, sample: Timestamp[bytes]) -> None:
        """Hand on the message of a sample. All in one step: every message takes this path."""
        if self._recent is not None:
            if sample.nanoseconds in self._recent:
                return
            self._recent.append(sample.nanoseconds)
        topic = self._topic
        try:
            message = deserialize_message(sample.value, topic.type)
        except RuntimeError:  # RMWError, which the rclpy of ROS 2 does not export
            self._drop(topic.name, f"{len(sample.value)} octets are no {topic.type_name}")
            return
        problem = topic.problem(message)
        if not problem and self._staleness is not None:
            problem = self._staleness(sample.timestamp)
        if problem:
            self._drop(topic.name, problem)
            return
        item: Any = sample._replace(value=message) if self._timestamped else message
        if self._item is not None:
            try:
                item = self._item(item)
            except Exception as error:
                self._observer.on_error(error)
                return
        self._observer.on_next(item)
