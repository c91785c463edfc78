"""Services: they answer requests."""

from __future__ import annotations

import inspect
import struct
import time
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any

from rclpy._dds import Reader
from rclpy._endpoint import ServiceEndpoint
from rclpy._service_side import ServiceSide
from rclpy._service_wire import RequestId, check_client, client_is_matched, unwrap, wrap
from rclpy._type_variables import SrvType, SrvTypeRequest, SrvTypeResponse  # noqa: F401 (re-export)
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.qos import QoSProfile
from rclpy.service_introspection import ServiceIntrospectionState  # noqa: F401 (re-export)
from service_msgs.msg import ServiceEventInfo

# [s] A request may arrive before discovery has found the client's reader. The reply waits for it this long.
_MATCH_TIMEOUT = 0.1


class Service(ServiceSide):
    """Answers requests with a callback. Created by :meth:`rclpy.node.Node.create_service`."""

    def __init__(
        self,
        service_impl: ServiceEndpoint,
        srv_type: Any,
        srv_name: str,
        callback: Callable[[Any, Any], Any],
        callback_group: CallbackGroup,
        qos_profile: QoSProfile,
    ) -> None:
        super().__init__(service_impl, srv_type, srv_name, callback_group, qos_profile)
        self._rclpy_replies = service_impl.writer
        self._rclpy_requests = service_impl.reader
        self._rclpy_known_clients: set[int] = set()
        self.callback = callback

    @property
    def handle(self) -> Reader:
        """The DDS reader of the requests. Raises InvalidHandle if the service was destroyed."""
        self._rclpy_check_usable()
        return self._rclpy_requests

    def send_response(self, response: Any, header: RequestId) -> None:
        """Answer the request of ``header``. Raises TypeError if ``response`` is of another type."""
        if not isinstance(response, self.srv_type.Response):
            expected = self.srv_type.Response._TYPE_NAME
            raise TypeError(f"{self._rclpy_name} must answer with {expected}, not {response!r}")
        data = wrap(header, self.srv_type.Response._serialize(response))
        self._rclpy_wait_for_client(header.publication_handle)
        # Another thread may just have destroyed the service.
        with suppress(InvalidHandle):
            self._rclpy_replies.write(data)
        self._rclpy_publish_request_event(ServiceEventInfo.RESPONSE_SENT, header, response=response)

    def _rclpy_publish_request_event(self, event_type: int, request_id: RequestId, **message: Any) -> None:
        # A server does not know the client's GID. Like rmw_cyclonedds, it uses the identity of the request.
        client = struct.pack("<QQ", request_id.client, request_id.publication_handle)
        self._rclpy_publish_event(event_type, client, request_id.sequence_number, **message)

    def _rclpy_wait_for_client(self, publication_handle: int) -> None:
        with self._rclpy_lock:
            if publication_handle in self._rclpy_known_clients:
                return
        deadline = time.monotonic() + _MATCH_TIMEOUT
        matched = client_is_matched(self._rclpy_requests, self._rclpy_replies, publication_handle)
        while matched is False and time.monotonic() < deadline:
            time.sleep(0.001)
            matched = client_is_matched(self._rclpy_requests, self._rclpy_replies, publication_handle)
        if matched:
            with self._rclpy_lock:
                if len(self._rclpy_known_clients) >= 1000:  # bounds the memory: most of them are gone
                    self._rclpy_known_clients.clear()
                self._rclpy_known_clients.add(publication_handle)

    # The interface that executors use for every entity.

    def _rclpy_take(self) -> tuple[Any, RequestId] | None:
        while not self._rclpy_destroyed and (sample := self._rclpy_requests.take()) is not None:
            try:
                check_client(self._rclpy_requests, sample.publication_handle)
                request_id, data = unwrap(sample.data)
                request = self.srv_type.Request._deserialize(data)
            except ValueError as error:
                self._rclpy_bad_input.drop(sample, error)
                continue
            request_id = request_id._replace(publication_handle=sample.publication_handle)
            self._rclpy_publish_request_event(ServiceEventInfo.REQUEST_RECEIVED, request_id, request=request)
            return request, request_id
        return None

    def _rclpy_execute(self, taken: tuple[Any, RequestId]) -> Coroutine[Any, Any, None] | None:
        request, request_id = taken
        response = self.callback(request, self.srv_type.Response())
        if inspect.iscoroutine(response):
            return self._rclpy_answer(response, request_id)
        self.send_response(response, request_id)
        return None

    async def _rclpy_answer(self, response: Coroutine[Any, Any, Any], request_id: RequestId) -> None:
        self.send_response(await response, request_id)
