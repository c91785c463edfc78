"""Subscriptions to topics."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from enum import Enum
from typing import Any

from rclpy._bad_input import BadInput
from rclpy._dds import Reader
from rclpy._endpoint import Owner, SubscriptionEndpoint
from rclpy._type_variables import MsgType  # noqa: F401 (re-export)
from rclpy.callback_groups import CallbackGroup
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import QoSProfile


class Subscription(Owner):
    """Calls back with each message of a topic. Created by :meth:`rclpy.node.Node.create_subscription`."""

    class CallbackType(Enum):
        MessageOnly = 0
        WithMessageInfo = 1

    def __init__(
        self,
        subscription_impl: SubscriptionEndpoint,
        msg_type: Any,
        topic: str,
        callback: Callable[..., Any],
        callback_group: CallbackGroup,
        qos_profile: QoSProfile,
        raw: bool,
        event_callbacks: SubscriptionEventCallbacks,
    ) -> None:
        super().__init__(subscription_impl.node, subscription_impl.name, subscription_impl.reader)
        self._rclpy_reader = subscription_impl.reader
        self._rclpy_handles = (self._rclpy_reader.condition,)
        self._rclpy_deserialize = msg_type._deserialize
        self._rclpy_bad_input = BadInput(self._rclpy_node._logger, self._rclpy_name)
        self.callback = callback
        self.callback_group = callback_group
        self.msg_type = msg_type
        self.topic = topic
        self.qos_profile = qos_profile
        self.raw = raw
        self.event_handlers = event_callbacks.create_event_handlers(callback_group, self._rclpy_reader, topic)

    @property
    def handle(self) -> Reader:
        """The DDS reader. Raises InvalidHandle if the subscription was destroyed."""
        self._rclpy_check_usable()
        return self._rclpy_reader

    @property
    def topic_name(self) -> str:
        """The fully qualified, remapped topic."""
        return self._rclpy_name

    @property
    def callback(self) -> Callable[..., Any]:
        """Called with each message, and with its info if it takes two arguments."""
        return self._callback

    @callback.setter
    def callback(self, value: Callable[..., Any]) -> None:
        self._callback = value
        self._callback_type = _callback_type(value)
        self._rclpy_takes_info = self._callback_type is Subscription.CallbackType.WithMessageInfo

    def get_publisher_count(self) -> int:
        return self.handle.matched()

    # The interface that executors use for every entity.

    def _rclpy_take(self) -> tuple[Any, ...] | None:
        """Return the arguments for the callback; drop and count malformed messages."""
        while not self._rclpy_destroyed and (sample := self._rclpy_reader.take(not self.raw)) is not None:
            try:
                message = sample.data if self.raw else self._rclpy_deserialize(sample.data)
            except ValueError as error:
                self._rclpy_bad_input.drop(sample, error)
                continue
            if not self._rclpy_takes_info:
                return (message,)
            return (message, sample.info())
        return None

    def _rclpy_execute(self, taken: tuple[Any, ...]) -> Any:
        return self._callback(*taken)


def _callback_type(callback: Callable[..., Any]) -> Subscription.CallbackType:
    """Return the arguments that a callback takes. Raises RuntimeError if neither one nor two fit."""
    try:
        signature = inspect.signature(callback)
    except (ValueError, TypeError):  # a builtin without a signature, such as list.append
        return Subscription.CallbackType.MessageOnly
    for arguments, kind in (
        ((object(),), Subscription.CallbackType.MessageOnly),
        ((object(), object()), Subscription.CallbackType.WithMessageInfo),
    ):
        try:
            signature.bind(*arguments)
            return kind
        except TypeError:
            continue
    raise RuntimeError(
        f"a subscription's callback takes a message, or a message and its info: not {callback!r}"
    )
