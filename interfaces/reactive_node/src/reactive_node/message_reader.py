"""The DDS reader of a topic that all observers of its messages share."""

from __future__ import annotations

import copy
import itertools
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.subscription import Subscription
from reactivex import abc

from reactive_node.end import End
from reactive_node.shared_reader import SharedReader
from reactive_node.stamps import Timestamp

_FORGOTTEN = 10 * 10**9  # [ns]: by then, the other reader will not deliver a message any more


class Pairs:
    """The messages that only one of two readers has delivered as yet."""

    def __init__(self) -> None:
        self._surplus: dict[int, tuple[int, int]] = {}
        """By source time: by how many the first reader is ahead (the second, if negative), and since when."""

    def __len__(self) -> int:
        """How many messages wait for their pair."""
        return len(self._surplus)

    def completes(self, time_: int, reader: int) -> bool:
        """Note that a reader, 1 or -1, delivers a message; return whether the other one has delivered it.

        Messages of two publishers may have the same source time.
        """
        surplus, _ = self._surplus.pop(time_, (0, 0))
        now = time.monotonic_ns()
        if surplus + reader:
            self._surplus[time_] = surplus + reader, now
        for oldest, (_, since) in [*itertools.islice(self._surplus.items(), 2)]:
            if since < now - _FORGOTTEN:
                del self._surplus[oldest]
        return surplus * reader < 0


class MessageReader(SharedReader):
    def __init__(
        self,
        node: Node,
        create: Callable[..., Subscription],
        qos_profile: QoSProfile | int,
        *,
        scheduler: abc.SchedulerBase,
        end: End,
        timestamped: bool,
        item: Callable[[Any], Any] | None,
        every_publisher: bool,
    ) -> None:
        """:param create: creates a reader of ``node`` with a callback, a QoS and further arguments of
        :meth:`rclpy.node.Node.create_subscription`. For the others see :class:`SharedReader` and
        :meth:`ReactiveNode.create_observable`.
        """
        super().__init__(
            node, create, scheduler=scheduler, end=end, item=item, retained=_retention(qos_profile)
        )
        self._qos = qos_profile
        self._timestamped = timestamped
        self._reads_every_publisher = every_publisher and self._retained is not None
        # rclpy collects the info of a message only for a callback that takes it.
        self._callback: Callable[..., None] = self._receive_with_info if timestamped else self._receive

    def _begin(self, scheduler: abc.SchedulerBase | None) -> None:
        options: dict[str, Any] = {}
        if self._reads_every_publisher:
            options["event_callbacks"] = SubscriptionEventCallbacks(incompatible_qos=self._add_volatile)
        self._subscriptions.append(self._create(self._callback, self._qos, **options))

    def _add_volatile(self, _: Any) -> None:
        """Read by a second reader as well: the first one receives nothing from a volatile publisher."""
        with self._lock:
            if len(self._subscriptions) == 1:
                self._pairs = Pairs()
                self._subscriptions[0].callback = partial(self._receive_once, 1)
                qos = copy.copy(self._qos)
                assert isinstance(qos, QoSProfile)
                qos.durability = DurabilityPolicy.VOLATILE
                self._subscriptions.append(self._create(partial(self._receive_once, -1), qos))

    def _receive_once(self, reader: int, message: Any, info: Any) -> None:
        """Hand on what a reader of two receives, unless the other one has delivered it."""
        if not self._pairs.completes(info["source_timestamp"], reader):
            self._receive_with_info(message, info) if self._timestamped else self._receive(message)

    def _receive_with_info(self, message: Any, info: Any) -> None:
        """Hand on a message with its source time."""
        # Without Timestamp(): where messages are rare, each call costs most.
        self._receive(tuple.__new__(Timestamp, (message, info["source_timestamp"])))


def _retention(qos_profile: QoSProfile | int) -> deque[Any] | None:
    """Return an empty store for the items that late observers get; None if they get none."""
    if isinstance(qos_profile, int) or qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL:
        return None
    return deque(maxlen=None if qos_profile.history == HistoryPolicy.KEEP_ALL else qos_profile.depth)
