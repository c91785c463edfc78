"""Publishers of topics."""

from __future__ import annotations

from typing import Any

from rclpy._dds import Writer
from rclpy._endpoint import Owner, PublisherEndpoint
from rclpy._type_variables import MsgType  # noqa: F401 (re-export)
from rclpy.callback_groups import CallbackGroup
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.exceptions import RCLError
from rclpy.qos import QoSProfile
from rosidl_runtime_embedded.pieces import Pieces


class Publisher(Owner):
    """Publishes messages of a type on a topic. Created by :meth:`rclpy.node.Node.create_publisher`."""

    def __init__(
        self,
        publisher_impl: PublisherEndpoint,
        msg_type: Any,
        topic: str,
        qos_profile: QoSProfile,
        event_callbacks: PublisherEventCallbacks,
        callback_group: CallbackGroup,
    ) -> None:
        super().__init__(publisher_impl.node, publisher_impl.name, publisher_impl.writer)
        self._rclpy_writer = publisher_impl.writer
        self._rclpy_context = publisher_impl.node.context
        self._rclpy_serialize = msg_type._serialize
        self.msg_type = msg_type
        self.topic = topic
        self.qos_profile = qos_profile
        self.event_handlers = event_callbacks.create_event_handlers(
            callback_group, publisher_impl.writer, topic
        )

    @property
    def handle(self) -> Writer:
        """The DDS writer. Raises InvalidHandle if the publisher was destroyed."""
        self._rclpy_check_usable()
        return self._rclpy_writer

    @property
    def topic_name(self) -> str:
        """The fully qualified, remapped topic."""
        return self._rclpy_name

    def publish(self, msg: Any) -> None:
        """Publish a message, or a serialized message (``bytes``).

        :raises TypeError: if ``msg`` is not of the publisher's type, or a field has a wrong type.
        :raises ValueError: if a field has a value that its type cannot represent.
        :raises RCLError: if the context was shut down.
        :raises InvalidHandle: if the publisher was destroyed.
        """
        if self._rclpy_destroyed:  # checked inline: this is the path of every message
            self._rclpy_check_usable()
        if not self._rclpy_context._rclpy_valid:
            raise RCLError(f"cannot publish on {self._rclpy_name}: the context was shut down")
        if msg.__class__ is self.msg_type or isinstance(msg, self.msg_type):
            self._rclpy_writer.write(self._rclpy_serialize(msg, Pieces))
        elif isinstance(msg, bytes):
            self._rclpy_writer.write(msg)
        else:
            expected = self.msg_type._TYPE_NAME
            raise TypeError(f"Expected {expected} on {self._rclpy_name}, got {type(msg).__name__}: {msg!r}")

    def get_subscription_count(self) -> int:
        return self.handle.matched()

    def assert_liveliness(self) -> None:
        """Assert that this publisher is alive, for liveliness MANUAL_BY_TOPIC."""
        self.handle.assert_liveliness()

    def wait_for_all_acked(self, timeout: Duration = Duration(seconds=-1)) -> bool:  # noqa: B008
        """Wait until reliable subscriptions have acknowledged all; ``timeout`` negative: no limit."""
        nanoseconds = timeout.nanoseconds
        return self.handle.wait_for_acks(nanoseconds if nanoseconds >= 0 else 2**63 - 1)
