"""The common base of services and clients: names and introspection events."""

from __future__ import annotations

import threading
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from rclpy._bad_input import BadInput
from rclpy._endpoint import Owner, ServiceEndpoint
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.qos import QoSProfile
from rclpy.service_introspection import ServiceIntrospectionState

if TYPE_CHECKING:
    from rclpy.clock import Clock
    from rclpy.publisher import Publisher


@dataclass(frozen=True)
class _Introspection:
    publisher: Publisher
    clock: Clock
    state: ServiceIntrospectionState


class ServiceSide(Owner):
    """A service, or a client of a service."""

    def __init__(
        self,
        endpoint: ServiceEndpoint,
        srv_type: Any,
        srv_name: str,
        callback_group: CallbackGroup,
        qos_profile: QoSProfile,
    ) -> None:
        super().__init__(endpoint.node, endpoint.name, endpoint.writer, endpoint.reader)
        self._rclpy_handles = (endpoint.reader.condition,)
        self._rclpy_bad_input = BadInput(self._rclpy_node._logger, self._rclpy_name)
        self._rclpy_lock = threading.Lock()
        self._rclpy_introspection: _Introspection | None = None
        self.srv_type = srv_type
        self.srv_name = srv_name
        self.callback_group = callback_group
        self.qos_profile = qos_profile

    @property
    def service_name(self) -> str:
        """The fully qualified, remapped name."""
        return self._rclpy_name

    def configure_introspection(
        self,
        clock: Clock,
        service_event_qos_profile: QoSProfile,
        introspection_state: ServiceIntrospectionState,
    ) -> None:
        """Publish the events of future calls on ``<service>/_service_event``.

        A new clock or QoS takes effect only if the state was OFF before, as in rclpy.

        :param clock: stamps the events.
        :param service_event_qos_profile: the QoS of the topic.
        :param introspection_state: the content of the events; OFF publishes none.
        :raises InvalidHandle: if the service or client was destroyed.
        """
        self._rclpy_check_usable()
        if introspection_state == ServiceIntrospectionState.OFF:
            self._rclpy_end_introspection()
        elif self._rclpy_introspection is not None:
            self._rclpy_introspection = replace(self._rclpy_introspection, state=introspection_state)
        else:
            publisher = self._rclpy_node._rclpy_create_own_publisher(
                self.srv_type.Event, f"{self._rclpy_name}/_service_event", service_event_qos_profile
            )
            self._rclpy_introspection = _Introspection(publisher, clock, introspection_state)

    def _rclpy_end_introspection(self) -> None:
        introspection, self._rclpy_introspection = self._rclpy_introspection, None
        if introspection is not None:
            introspection.publisher.destroy()

    def _rclpy_publish_event(
        self, event_type: int, client_gid: bytes, sequence_number: int, **message: Any
    ) -> None:
        """Publish an event unless introspection is off; ``message`` is the ``request`` or ``response``."""
        introspection = self._rclpy_introspection
        if introspection is None:
            return
        event = self.srv_type.Event()
        event.info.event_type = event_type
        event.info.stamp = introspection.clock.now().to_msg()
        event.info.client_gid = client_gid
        event.info.sequence_number = sequence_number
        if introspection.state == ServiceIntrospectionState.CONTENTS:
            for name, value in message.items():
                setattr(event, name, [value])
        with suppress(InvalidHandle):  # another thread may just have switched it off
            introspection.publisher.publish(event)

    def destroy(self) -> None:
        """Destroy it. The node's ``destroy_…`` method also removes it from the node."""
        self._rclpy_end_introspection()
        super().destroy()
