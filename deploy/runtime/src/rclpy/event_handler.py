"""QoS events: missed deadlines, changes of liveliness, incompatible QoS, lost messages, matches."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from rclpy import logging
from rclpy._dds import Reader, Writer
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import UnsupportedEventTypeError  # noqa: F401 (re-export)
from rclpy.qos import QoSPolicyKind, qos_policy_name_from_kind
from rclpy.waitable import NumberOfEntities, Waitable


class QoSPublisherEventType(IntEnum):
    RCL_PUBLISHER_OFFERED_DEADLINE_MISSED = 0
    RCL_PUBLISHER_LIVELINESS_LOST = 1
    RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS = 2
    RCL_PUBLISHER_INCOMPATIBLE_TYPE = 3
    RCL_PUBLISHER_MATCHED = 4


class QoSSubscriptionEventType(IntEnum):
    RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED = 0
    RCL_SUBSCRIPTION_LIVELINESS_CHANGED = 1
    RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS = 2
    RCL_SUBSCRIPTION_MESSAGE_LOST = 3
    RCL_SUBSCRIPTION_INCOMPATIBLE_TYPE = 4
    RCL_SUBSCRIPTION_MATCHED = 5


@dataclass
class _Count:
    total_count: int
    total_count_change: int


class QoSRequestedDeadlineMissedInfo(_Count):
    """Number of deadlines in which a subscription got no message."""


class QoSOfferedDeadlineMissedInfo(_Count):
    """Number of deadlines in which a publisher published no message."""


class QoSLivelinessLostInfo(_Count):
    """Number of times that a publisher did not assert its liveliness in time."""


class QoSMessageLostInfo(_Count):
    """Number of messages that a subscription lost."""


class IncompatibleTypeInfo(_Count):
    """Number of endpoints with another type on the same topic."""


@dataclass
class QoSLivelinessChangedInfo:
    """Numbers of matched publishers that are alive and that are not."""

    alive_count: int
    not_alive_count: int
    alive_count_change: int
    not_alive_count_change: int


@dataclass
class _Incompatible(_Count):
    last_policy_kind: QoSPolicyKind


class QoSOfferedIncompatibleQoSInfo(_Incompatible):
    """Number of subscriptions that request more than a publisher offers, and the last policy concerned."""


class QoSRequestedIncompatibleQoSInfo(_Incompatible):
    """Number of publishers that offer less than a subscription requests, and the last policy concerned."""


@dataclass
class _Matched(_Count):
    current_count: int
    current_count_change: int


class QoSPublisherMatchedInfo(_Matched):
    """Numbers of subscriptions that are matched now and that ever were."""


class QoSSubscriptionMatchedInfo(_Matched):
    """Numbers of publishers that are matched now and that ever were."""


_POLICY_KINDS = {
    2: QoSPolicyKind.DURABILITY,
    4: QoSPolicyKind.DEADLINE,
    8: QoSPolicyKind.LIVELINESS,
    11: QoSPolicyKind.RELIABILITY,
    13: QoSPolicyKind.HISTORY,
    21: QoSPolicyKind.LIFESPAN,
}

# Cyclone DDS has no status for different types. rmw_cyclonedds accepts a callback, and so does this runtime.
_NO_STATUS = ""

# The DDS status of each event, and the type of the callback's argument.
_PUBLISHER_EVENTS: dict[int, tuple[str, Callable[..., Any]]] = {
    QoSPublisherEventType.RCL_PUBLISHER_OFFERED_DEADLINE_MISSED: (
        "offered_deadline_missed",
        QoSOfferedDeadlineMissedInfo,
    ),
    QoSPublisherEventType.RCL_PUBLISHER_LIVELINESS_LOST: ("liveliness_lost", QoSLivelinessLostInfo),
    QoSPublisherEventType.RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS: (
        "offered_incompatible_qos",
        QoSOfferedIncompatibleQoSInfo,
    ),
    QoSPublisherEventType.RCL_PUBLISHER_INCOMPATIBLE_TYPE: (_NO_STATUS, IncompatibleTypeInfo),
    QoSPublisherEventType.RCL_PUBLISHER_MATCHED: ("publication_matched", QoSPublisherMatchedInfo),
}
_SUBSCRIPTION_EVENTS: dict[int, tuple[str, Callable[..., Any]]] = {
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED: (
        "requested_deadline_missed",
        QoSRequestedDeadlineMissedInfo,
    ),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_LIVELINESS_CHANGED: (
        "liveliness_changed",
        QoSLivelinessChangedInfo,
    ),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS: (
        "requested_incompatible_qos",
        QoSRequestedIncompatibleQoSInfo,
    ),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST: ("sample_lost", QoSMessageLostInfo),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_INCOMPATIBLE_TYPE: (_NO_STATUS, IncompatibleTypeInfo),
    QoSSubscriptionEventType.RCL_SUBSCRIPTION_MATCHED: ("subscription_matched", QoSSubscriptionMatchedInfo),
}


def _info(make: Callable[..., Any], found: dict[str, int]) -> Any:
    """Convert the fields of a DDS status to the callback's argument."""
    values: dict[str, Any] = {name: value for name, value in found.items() if not name.startswith("last_")}
    if "last_policy_id" in found:
        values["last_policy_kind"] = _POLICY_KINDS.get(found["last_policy_id"], QoSPolicyKind.INVALID)
    return make(**values)


class EventHandler(Waitable):
    """Calls back for one type of event of a publisher or subscription."""

    def __init__(
        self,
        *,
        callback_group: CallbackGroup,
        callback: Callable[[Any], Any],
        event_type: IntEnum,
        parent_impl: Writer | Reader,
    ) -> None:
        """Create a handler. Publishers and subscriptions create theirs from their event callbacks."""
        super().__init__(callback_group)
        events = _PUBLISHER_EVENTS if isinstance(event_type, QoSPublisherEventType) else _SUBSCRIPTION_EVENTS
        self.callback = callback
        self.event_type = event_type
        self._rclpy_status, self._rclpy_make_info = events[event_type]
        self._rclpy_parent = parent_impl
        self._rclpy_destroyed = False
        self._rclpy_index = 0

    def destroy(self) -> None:
        self._rclpy_destroyed = True

    def get_num_entities(self) -> NumberOfEntities:
        return NumberOfEntities(num_events=1)

    def add_to_wait_set(self, wait_set: Any) -> None:
        """Add the DDS entity; executors do without for the handlers of publishers and subscriptions."""
        if self._rclpy_status != _NO_STATUS:
            self._rclpy_parent.watch_also(self._rclpy_status)
        self._rclpy_index = wait_set._add("event", self._rclpy_parent.handle)

    def is_ready(self, wait_set: Any) -> bool:
        """Return whether the DDS entity has any event."""
        return bool(wait_set.is_ready("event", self._rclpy_index))

    async def execute(self, taken_data: Any) -> None:
        """Call back, unless the event is of another type."""
        if taken_data is not None:
            result = self.callback(taken_data)
            if inspect.iscoroutine(result):
                await result

    def take_data(self) -> Any:
        """Return the changes since the last call, ``None`` without any."""
        if self._rclpy_destroyed or self._rclpy_status == _NO_STATUS:
            return None
        found = self._rclpy_parent.changed(self._rclpy_status)
        return None if found is None else _info(self._rclpy_make_info, found)


class QoSEventHandler(EventHandler):
    """The name of :class:`EventHandler` before ROS 2 Iron."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        warnings.warn("QoSEventHandler is deprecated: use EventHandler instead", stacklevel=2)
        super().__init__(*args, **kwargs)


def _handlers(
    callbacks: dict[IntEnum, Callable[[Any], Any] | None],
    callback_group: CallbackGroup,
    parent: Writer | Reader,
) -> list[EventHandler]:
    handlers = [
        EventHandler(callback_group=callback_group, callback=callback, event_type=event, parent_impl=parent)
        for event, callback in callbacks.items()
        if callback is not None
    ]
    parent.watch([handler._rclpy_status for handler in handlers if handler._rclpy_status != _NO_STATUS])
    return handlers


def _warn_of_incompatible_qos(logger_name: str, text: str) -> Callable[[Any], None]:
    def warn(info: _Incompatible) -> None:
        policy = qos_policy_name_from_kind(info.last_policy_kind)
        logging.get_logger(logger_name).warning(f"{text} Last incompatible policy: {policy}")

    return warn


class SubscriptionEventCallbacks:
    def __init__(
        self,
        *,
        deadline: Callable[[QoSRequestedDeadlineMissedInfo], None] | None = None,
        incompatible_qos: Callable[[QoSRequestedIncompatibleQoSInfo], None] | None = None,
        liveliness: Callable[[QoSLivelinessChangedInfo], None] | None = None,
        message_lost: Callable[[QoSMessageLostInfo], None] | None = None,
        incompatible_type: Callable[[IncompatibleTypeInfo], None] | None = None,
        matched: Callable[[QoSSubscriptionMatchedInfo], None] | None = None,
        use_default_callbacks: bool = True,
    ) -> None:
        """Choose the callbacks; by default, incompatible QoS is logged as a warning."""
        self.deadline = deadline
        self.incompatible_qos = incompatible_qos
        self.liveliness = liveliness
        self.message_lost = message_lost
        self.incompatible_type = incompatible_type
        self.matched = matched
        self.use_default_callbacks = use_default_callbacks

    def create_event_handlers(
        self, callback_group: CallbackGroup, subscription: Reader, topic_name: str
    ) -> list[EventHandler]:
        incompatible_qos = self.incompatible_qos
        if incompatible_qos is None and self.use_default_callbacks:
            text = (
                f"New publisher discovered on topic '{topic_name}', offering incompatible QoS. "
                "No messages will be received from it."
            )
            incompatible_qos = _warn_of_incompatible_qos(subscription.logger_name, text)
        kind = QoSSubscriptionEventType
        return _handlers(
            {
                kind.RCL_SUBSCRIPTION_REQUESTED_DEADLINE_MISSED: self.deadline,
                kind.RCL_SUBSCRIPTION_REQUESTED_INCOMPATIBLE_QOS: incompatible_qos,
                kind.RCL_SUBSCRIPTION_LIVELINESS_CHANGED: self.liveliness,
                kind.RCL_SUBSCRIPTION_MESSAGE_LOST: self.message_lost,
                kind.RCL_SUBSCRIPTION_INCOMPATIBLE_TYPE: self.incompatible_type,
                kind.RCL_SUBSCRIPTION_MATCHED: self.matched,
            },
            callback_group,
            subscription,
        )


class PublisherEventCallbacks:
    def __init__(
        self,
        *,
        deadline: Callable[[QoSOfferedDeadlineMissedInfo], None] | None = None,
        liveliness: Callable[[QoSLivelinessLostInfo], None] | None = None,
        incompatible_qos: Callable[[QoSOfferedIncompatibleQoSInfo], None] | None = None,
        incompatible_type: Callable[[IncompatibleTypeInfo], None] | None = None,
        matched: Callable[[QoSPublisherMatchedInfo], None] | None = None,
        use_default_callbacks: bool = True,
    ) -> None:
        self.deadline = deadline
        self.liveliness = liveliness
        self.incompatible_qos = incompatible_qos
        self.incompatible_type = incompatible_type
        self.matched = matched
        self.use_default_callbacks = use_default_callbacks

    def create_event_handlers(
        self, callback_group: CallbackGroup, publisher: Writer, topic_name: str
    ) -> list[EventHandler]:
        incompatible_qos = self.incompatible_qos
        if incompatible_qos is None and self.use_default_callbacks:
            text = (
                f"New subscription discovered on topic '{topic_name}', requesting incompatible QoS. "
                "No messages will be sent to it."
            )
            incompatible_qos = _warn_of_incompatible_qos(publisher.logger_name, text)
        kind = QoSPublisherEventType
        return _handlers(
            {
                kind.RCL_PUBLISHER_OFFERED_DEADLINE_MISSED: self.deadline,
                kind.RCL_PUBLISHER_LIVELINESS_LOST: self.liveliness,
                kind.RCL_PUBLISHER_OFFERED_INCOMPATIBLE_QOS: incompatible_qos,
                kind.RCL_PUBLISHER_INCOMPATIBLE_TYPE: self.incompatible_type,
                kind.RCL_PUBLISHER_MATCHED: self.matched,
            },
            callback_group,
            publisher,
        )


class EndpointEvents:
    """All events of a publisher or subscription: an executor waits for them on one DDS entity."""

    def __init__(self, handlers: list[EventHandler], parent: Writer | Reader) -> None:
        self._rclpy_handlers = handlers
        self._rclpy_handles = (parent.handle,)
        self.callback_group = handlers[0].callback_group

    def _rclpy_take(self) -> list[tuple[EventHandler, Any]] | None:
        events = [
            (handler, data) for handler in self._rclpy_handlers if (data := handler.take_data()) is not None
        ]
        return events or None

    def _rclpy_execute(self, taken: list[tuple[EventHandler, Any]]) -> Any:
        results = [handler.callback(data) for handler, data in taken]
        coroutines = [result for result in results if inspect.iscoroutine(result)]
        return _await_all(coroutines) if coroutines else None


async def _await_all(coroutines: list[Any]) -> None:
    for coroutine in coroutines:
        await coroutine
