"""The DDS reader of a topic that all observers of its messages share."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rclpy.subscription import Subscription
from reactivex import abc

from reactive_node.end import End
from reactive_node.shared_reader import SharedReader
from reactive_node.stamps import Timestamp

_RECENT = 16  # messages that a second reader may deliver again


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
        self._recent: deque[int] | None = None  # source times, while there are two readers
        # rclpy collects the info of a message only for a callback that takes it.
        self._callback: Callable[..., None] = self._receive_with_info if timestamped else self._receive

    def _begin(self, scheduler: abc.SchedulerBase | None) -> None:
        self._recent = None
        options: dict[str, Any] = {}
        if self._reads_every_publisher:
            options["event_callbacks"] = SubscriptionEventCallbacks(incompatible_qos=self._add_volatile)
        self._subscriptions.append(self._create(self._callback, self._qos, **options))

    def _add_volatile(self, _: Any) -> None:
        """Read by a second reader as well: the first one receives nothing from a volatile publisher."""
        with self._lock:
            if len(self._subscriptions) == 1:
                self._recent = deque(maxlen=_RECENT)
                self._subscriptions[0].callback = self._receive_with_info
                qos = copy.copy(self._qos)
                assert isinstance(qos, QoSProfile)
                qos.durability = DurabilityPolicy.VOLATILE
                self._subscriptions.append(self._create(self._receive_with_info, qos))

    def _receive_with_info(self, message: Any, info: Any) -> None:
        """Hand on a message whose source time matters, unless the other reader has delivered it."""
        if self._recent is not None:
            if info["source_timestamp"] in self._recent:
                return
            self._recent.append(info["source_timestamp"])
        if self._timestamped:  # without Timestamp(): where messages are rare, each call costs most
            message = tuple.__new__(Timestamp, (message, info["source_timestamp"]))
        self._receive(message)


def _retention(qos_profile: QoSProfile | int) -> deque[Any] | None:
    """Return an empty store for the items that late observers get; None if they get none."""
    if isinstance(qos_profile, int) or qos_profile.durability != DurabilityPolicy.TRANSIENT_LOCAL:
        return None
    return deque(maxlen=None if qos_profile.history == HistoryPolicy.KEEP_ALL else qos_profile.depth)
