"""Clients: they call services."""

from __future__ import annotations

import itertools
import threading
from typing import TYPE_CHECKING, Any

from rclpy._dds import Writer
from rclpy._endpoint import ServiceEndpoint
from rclpy._service_side import ServiceSide
from rclpy._service_wire import RequestId, has_other_servers, server_is_matched, unwrap, wrap
from rclpy._type_variables import SrvType, SrvTypeRequest, SrvTypeResponse  # noqa: F401 (re-export)
from rclpy.callback_groups import CallbackGroup
from rclpy.exceptions import RCLError
from rclpy.qos import QoSProfile
from rclpy.task import Future
from service_msgs.msg import ServiceEventInfo

if TYPE_CHECKING:
    from rclpy.context import Context


class Client(ServiceSide):
    """Calls a service. Created by :meth:`rclpy.node.Node.create_client`."""

    def __init__(
        self,
        context: Context,
        client_impl: ServiceEndpoint,
        srv_type: Any,
        srv_name: str,
        qos_profile: QoSProfile,
        callback_group: CallbackGroup,
    ) -> None:
        super().__init__(client_impl, srv_type, srv_name, callback_group, qos_profile)
        self._rclpy_requests = client_impl.writer
        self._rclpy_replies = client_impl.reader
        self._rclpy_identifier = client_impl.identifier
        self._rclpy_sequence_numbers = itertools.count(1)
        self._pending_requests: dict[int, Future] = {}
        self.context = context

    @property
    def handle(self) -> Writer:
        """The DDS writer of the requests. Raises InvalidHandle if the client was destroyed."""
        self._rclpy_check_usable()
        return self._rclpy_requests

    def call(self, request: Any, timeout_sec: float | None = None) -> Any:
        """Call the service and wait for the reply, at most ``timeout_sec``; return ``None`` without a reply.

        Another thread must spin the node, so do not call this in a callback.

        :raises TypeError: if ``request`` is not of the service's request type.
        """
        event = threading.Event()
        future = self.call_async(request)
        future._rclpy_call_when_complete(event.set)
        self.context._rclpy_wake_on_shutdown(event)
        event.wait(timeout_sec)
        if not future.done():
            self.remove_pending_request(future)
        return future.result()

    def call_async(self, request: Any) -> Future:
        """Call the service; the future gets the reply. To stop waiting, cancel it or remove the request.

        A server on another DDS than Cyclone would misread the request: then it is logged, and not sent.

        :raises TypeError: if ``request`` is not of the service's request type.
        """
        if not isinstance(request, self.srv_type.Request):
            expected = self.srv_type.Request._TYPE_NAME
            raise TypeError(f"{self._rclpy_name} is called with {expected}, not {request!r}")
        data = self.srv_type.Request._serialize(request)
        future = Future(executor=self._rclpy_node.executor)
        with self._rclpy_lock:
            number = next(self._rclpy_sequence_numbers)
            self._pending_requests[number] = future
        # Not a done callback, which only runs on an executor.
        future._rclpy_call_when_complete(lambda: self.remove_pending_request(future))
        if has_other_servers(self.handle):
            self._rclpy_node.get_logger().error(
                f"did not call {self._rclpy_name}: a server is on another DDS, and ROS 2 has no common form"
                " of requests; use the same middleware for both"
            )
            return future
        self._rclpy_requests.write(wrap(RequestId(self._rclpy_requests.instance_handle, number), data))
        self._rclpy_publish_event(
            ServiceEventInfo.REQUEST_SENT, self._rclpy_identifier, number, request=request
        )
        return future

    def get_pending_request(self, sequence_number: int) -> Future:
        """Return the future of a request without a reply. Raises KeyError if there is none."""
        with self._rclpy_lock:
            return self._pending_requests[sequence_number]

    def remove_pending_request(self, future: Future) -> None:
        """Stop waiting for the reply to a request: its future will not be completed."""
        with self._rclpy_lock:
            for number, pending in list(self._pending_requests.items()):
                if pending is future:
                    del self._pending_requests[number]

    def service_is_ready(self) -> bool:
        """Whether a server is matched both ways, none on another DDS. Raises RCLError after the shutdown."""
        if not self.context.ok():
            raise RCLError(f"cannot look for a server of {self._rclpy_name}: the context was shut down")
        return server_is_matched(self.handle, self._rclpy_replies)

    def wait_for_service(self, timeout_sec: float | None = None) -> bool:
        """Return whether a server comes within ``timeout_sec`` (``None``: no limit). RCLError at shutdown."""
        timeout = None if timeout_sec is None else max(0.0, timeout_sec)
        graph = self._rclpy_node._rclpy_graph
        return graph.wait_for(self.service_is_ready, timeout, self.context.ok) or self.service_is_ready()

    # The interface that executors use for every entity.

    def _rclpy_take(self) -> tuple[Future, Any] | None:
        while not self._rclpy_destroyed and (sample := self._rclpy_replies.take()) is not None:
            try:
                request_id, data = unwrap(sample.data)
                if request_id.client != self._rclpy_requests.instance_handle:
                    continue  # all clients of a service share a topic: this reply is for another client
                response = self.srv_type.Response._deserialize(data)
            except ValueError as error:
                self._rclpy_bad_input.drop(sample, error)
                continue
            number = request_id.sequence_number
            self._rclpy_publish_event(
                ServiceEventInfo.RESPONSE_RECEIVED, self._rclpy_identifier, number, response=response
            )
            with self._rclpy_lock:
                future = self._pending_requests.get(number)
            if future is not None:
                return future, response
            self._rclpy_ignore_reply()
        return None

    def _rclpy_ignore_reply(self) -> None:
        """Do nothing for a reply to a request that was removed, or that another server has answered."""

    def _rclpy_execute(self, taken: tuple[Future, Any]) -> None:
        future, response = taken
        future._set_executor(self._rclpy_node.executor)
        future.set_result(response)
