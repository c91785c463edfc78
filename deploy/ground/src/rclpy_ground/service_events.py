"""Service introspection: what a client or a service publishes about its requests and responses (REP 2012)."""

from __future__ import annotations

import struct
from typing import Any

from rclpy_ground.clocks import Clock
from rclpy_ground.genuine import genuine
from rclpy_ground.nodes import Node
from rclpy_ground.topics import Publisher

REQUEST_SENT, REQUEST_RECEIVED, RESPONSE_SENT, RESPONSE_RECEIVED = range(4)
"""The types of events (service_msgs/msg/ServiceEventInfo)."""
_STATES = genuine.service_introspection.ServiceIntrospectionState


class ServiceEvents:
    """The events of one side, on a topic beside the service; none until it is configured."""

    def __init__(self, node: Node, service: Any, name: str) -> None:
        self._node, self._service, self._topic = node, service, f"{name}/_service_event"
        self._publisher: Publisher | None = None
        self._has_contents = False
        self._clock: Clock | None = None

    def configure(self, clock: Clock, qos: Any, state: Any) -> None:
        """Publish nothing, metadata, or the requests and responses as well, with times of a clock."""
        self.close()
        self._clock, self._has_contents = clock, state == _STATES.CONTENTS
        if state != _STATES.OFF:
            self._publisher = Publisher(self._node, self._service.Event, self._topic, qos)

    def publish(self, event_type: int, client: int, number: int, **contents: Any) -> None:
        """Publish an event; ``contents`` are its request or its response."""
        if self._publisher is None or self._clock is None:
            return
        from builtin_interfaces.msg import Time
        from service_msgs.msg import ServiceEventInfo

        seconds, nanoseconds = divmod(self._clock.nanoseconds(), 10**9)
        event = self._service.Event()
        event.info = ServiceEventInfo(
            event_type=event_type,
            stamp=Time(sec=seconds, nanosec=nanoseconds),
            client_gid=list(self._node.participant.gid[:12] + struct.pack("<I", client & 0xFFFFFFFF)),
            sequence_number=number,
        )
        if self._has_contents:
            for name, message in contents.items():
                setattr(event, name, [message])
        self._publisher.publish(event)

    def close(self) -> None:
        publisher, self._publisher = self._publisher, None
        if publisher is not None:
            publisher.destroy_when_not_in_use()
