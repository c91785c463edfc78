"""Publishers and subscriptions."""

from __future__ import annotations

import time
from typing import Any

from rclpy_ground import best_available
from rclpy_ground.genuine import RCLError, genuine, predefined
from rclpy_ground.handles import Destroyable
from rclpy_ground.interface import INFINITY, EndpointOfGround
from rclpy_ground.messages import deserialize, rclpy_serialize, type_of
from rclpy_ground.nodes import Node


class OfNode(Destroyable):
    """An object that belongs to a node."""

    node: Node

    def get_logger_name(self) -> str:
        return self.node.logger


class WithEvents(OfNode):
    """An endpoint of a topic, whose statuses events show."""

    endpoint: EndpointOfGround


def check_name(name: str, node: Node) -> None:
    """Raise for a name that no topic or service can have, or after the shutdown of the context."""
    node.check_context()
    if genuine.rclpy_get_validation_error_for_topic_name(name) or not is_full_name(node.expand(name)):
        raise ValueError(f"invalid topic name '{name}'")


def is_full_name(name: str) -> bool:
    return not genuine.rclpy_get_validation_error_for_full_topic_name(name)


def profile_of(qos: Any) -> Any:
    """Return the QoSProfile of an rmw_qos_profile_t; of ``None``, the default one."""
    from rclpy.qos import QoSProfile

    return QoSProfile(**(predefined("qos_profile_default") if qos is None else qos).to_dict())


def _dds_name(topic: str, profile: Any) -> str:
    return topic if profile.avoid_ros_namespace_conventions else f"rt{topic}"


class Publisher(WithEvents):
    def __init__(self, node: Node, message: Any, topic: str, qos: Any) -> None:
        check_name(topic, node)
        self.node = node
        self._name = node.resolve(topic, is_service=False)
        profile = profile_of(qos)
        dds_name = _dds_name(self._name, profile)
        if best_available.has_open_policy(profile):
            best_available.for_publisher(profile, dds_name, node.discovery().readers())
        self._message = message
        self._context = node.context
        self.endpoint = self.writer = node.create_writer(dds_name, message, profile)
        node.note_type(message, "message")
        self.writer.watch([])
        super().__init__()

    def publish(self, message: Any) -> None:
        if not self._context.is_valid:
            raise RCLError("Failed to publish: publisher's context is invalid")
        self.writer.write(rclpy_serialize(message, self._message))

    def publish_raw(self, data: bytes) -> None:
        if not self._context.is_valid:
            raise RCLError("Failed to publish: publisher's context is invalid")
        self.writer.write(data)

    def get_subscription_count(self) -> int:
        return self.writer.matched()

    def get_topic_name(self) -> str:
        return self._name

    def wait_for_all_acked(self, timeout: Any) -> bool:
        if not self._context.is_valid:
            raise RCLError("Failed to wait for all acknowledgements: publisher's context is invalid")
        limit = timeout.nanoseconds
        return self.writer.wait_for_acks(limit if limit >= 0 else INFINITY)

    def destroy(self) -> None:
        self.writer.close()


def rclpy_assert_liveliness(publisher: Publisher) -> None:
    publisher.writer.assert_liveliness()


class Subscription(WithEvents):
    def __init__(self, node: Node, message: Any, topic: str, qos: Any, content_filter: Any = None) -> None:
        check_name(topic, node)
        self.node = node
        self._name = node.resolve(topic, is_service=False)
        profile = profile_of(qos)
        dds_name = _dds_name(self._name, profile)
        if best_available.has_open_policy(profile):
            best_available.for_subscription(profile, dds_name, node.discovery().writers())
        self.endpoint = self._reader = node.create_reader(dds_name, message, profile)
        node.note_type(message, "message")
        self._reader.watch([])
        self.condition = self._reader.condition
        self._has_bad = False
        super().__init__()

    def take_message(self, message: Any, raw: bool) -> tuple[Any, dict[str, Any]] | None:
        sample = self._reader.take()
        if sample is None:
            return None
        data: Any = sample.data
        if not raw:
            try:
                data = deserialize(data, message)
            except RuntimeError:
                self._note_bad(message)
                return None
        return data, {
            "source_timestamp": sample.source_timestamp,
            "received_timestamp": time.time_ns(),
            "publication_sequence_number": None,
            "reception_sequence_number": None,
        }

    def _note_bad(self, message: Any) -> None:
        """Warn of messages that are dropped, as by Fast DDS: anybody may write what cannot be read."""
        from rclpy.logging import get_logger

        if not self._has_bad:
            self._has_bad = True
            text = f"{self._name}: dropped a message that is no {type_of(message)[0]}; further ones too"
            get_logger(self.node.logger).warning(text)

    def get_publisher_count(self) -> int:
        return self._reader.matched()

    def get_topic_name(self) -> str:
        return self._name

    def is_cft_enabled(self) -> bool:
        return False

    def destroy(self) -> None:
        self._reader.close()
