"""Services and clients: as in rmw_cyclonedds, a header of client and number stands before the message.

Other middleware has no such header, and takes it for the message (ros2/rmw_cyclonedds#184). Endpoints of our
form have an identifier in their USER_DATA; requests to and from others are not sent and not taken.
"""

from __future__ import annotations

import itertools
import re
import struct
import time
from contextlib import suppress
from typing import Any

from rclpy_ground import best_available, choice
from rclpy_ground.clocks import Clock
from rclpy_ground.genuine import RCLError, RMWError, predefined
from rclpy_ground.handles import Destroyable
from rclpy_ground.interface import Reader, Writer, user_data_value
from rclpy_ground.messages import deserialize, rclpy_serialize
from rclpy_ground.nodes import Node
from rclpy_ground.service_events import (
    REQUEST_RECEIVED,
    REQUEST_SENT,
    RESPONSE_RECEIVED,
    RESPONSE_SENT,
    ServiceEvents,
)
from rclpy_ground.topics import OfNode, check_name, profile_of

_HEADER = struct.Struct("<4sQq")
_FOR_READER, _BETWEEN_LOOKS = 0.1, 0.001  # s
_HASH = re.compile("RIHS01_[0-9a-fA-F]{64}")
_ENCAPSULATION = b"\x00\x01\x00\x00"  # CDR, little endian (RTPS 2.5, 10.2)


class rmw_request_id_t:
    __slots__ = ("client", "publication_handle", "sequence_number")

    def __init__(self, client: int, sequence_number: int, publication_handle: int) -> None:
        self.client = client
        self.sequence_number = sequence_number
        self.publication_handle = publication_handle


class rmw_service_info_t:
    __slots__ = ("received_timestamp", "request_id", "source_timestamp")

    def __init__(self, request_id: rmw_request_id_t, sent: int) -> None:
        self.request_id = request_id
        self.source_timestamp = sent
        self.received_timestamp = time.time_ns()


def _with_header(client: int, number: int, data: bytes) -> bytes:
    return _HEADER.pack(_ENCAPSULATION, client, number) + data[4:]


def _service_id(node: Node) -> str:
    """Return the text by which others know that a writer and a reader belong together."""
    gid: bytes = node.participant.gid[:12] + struct.pack(">I", next(node.context.service_ids))
    return ".".join(format(octet, "02x") for octet in gid)


class _Side(OfNode):
    """A client or a service."""

    writer: Writer
    reader: Reader

    def __init__(self, node: Node, service: Any, name: str, qos: Any) -> None:
        check_name(name, node)
        self.node = node
        self.name = node.resolve(name, is_service=True)
        self.request_topic, self.reply_topic = f"rq{self.name}Request", f"rr{self.name}Reply"
        self.request, self.response = service.Request, service.Response
        self.profile = profile_of(qos)
        best_available.for_service(self.profile)
        self._events = ServiceEvents(node, service, self.name)
        node.note_type(service, "service")
        self.writer, self.reader = self._open()
        self.condition = self.reader.condition
        super().__init__()

    def _open(self) -> tuple[Writer, Reader]:
        raise NotImplementedError

    def _take(self, message: Any, client: int | None) -> tuple[rmw_service_info_t, Any] | None:
        """Take a message for a client, or for a service (``None``); drop those that cannot be read."""
        while (sample := self.reader.take()) is not None:
            if len(sample.data) < _HEADER.size:
                continue
            encapsulation, sender, number = _HEADER.unpack_from(sample.data)
            if sender == client or (client is None and self._is_of_our_form(sample.publication_handle)):
                request_id = rmw_request_id_t(sender, number, sample.publication_handle)
                data = encapsulation + sample.data[_HEADER.size :]
                with suppress(RMWError):  # anybody may send such a request
                    return rmw_service_info_t(request_id, sample.source_timestamp), deserialize(data, message)
        return None

    def _is_of_our_form(self, publication_handle: int) -> bool:
        data = self.reader.user_data_of(publication_handle)
        return data is None or bool(user_data_value(data, "clientid"))  # None: the client has gone

    def configure_introspection(self, clock: Clock, qos: Any, state: Any) -> None:
        """Publish an event for each request and response, or no longer."""
        self._events.configure(clock, qos, state)

    def destroy(self) -> None:
        self._events.close()
        self.writer.close()
        self.reader.close()


class Client(_Side):
    def __init__(self, node: Node, service: Any, name: str, qos: Any) -> None:
        super().__init__(node, service, name, qos)
        self._numbers = itertools.count(1)
        self._id = self.writer.instance_handle

    def _open(self) -> tuple[Writer, Reader]:
        extra = f"clientid={_service_id(self.node)};"
        writer = self.node.create_writer(self.request_topic, self.request, self.profile, extra)
        return writer, self.node.create_reader(self.reply_topic, self.response, self.profile, extra)

    @property
    def service_name(self) -> str:
        return self.name

    def send_request(self, request: Any) -> int:
        """Send a request; return its number."""
        if not self.node.context.is_valid:
            raise RCLError("failed to send request: the context is invalid")
        if not all(user_data_value(each, "serviceid") for each in self.writer.matched_user_data()):
            raise RCLError(
                f"did not call {self.name}: a server is on another DDS, and ROS 2 has no common form of"
                " requests; use the same middleware for both"
            )
        number = next(self._numbers)
        data = _with_header(self._id, number, rclpy_serialize(request, self.request))
        self.writer.write(data, is_request=True)
        self._events.publish(REQUEST_SENT, self._id, number, request=request)
        return number

    def take_response(self, message: Any) -> tuple[rmw_service_info_t | None, Any]:
        taken = self._take(message, self._id)
        if taken is None:
            return None, None
        self._events.publish(
            RESPONSE_RECEIVED, self._id, taken[0].request_id.sequence_number, response=taken[1]
        )
        return taken

    def service_server_is_available(self) -> bool:
        choice.ground.note_poll()
        self.node.check_context()
        readers = {user_data_value(each, "serviceid") for each in self.writer.matched_user_data()}
        writers = {user_data_value(each, "serviceid") for each in self.reader.matched_user_data()}
        return "" not in readers and bool(readers & writers)


class Service(_Side):
    def _open(self) -> tuple[Writer, Reader]:
        extra = f"serviceid={_service_id(self.node)};"
        writer = self.node.create_writer(self.reply_topic, self.response, self.profile, extra)
        return writer, self.node.create_reader(self.request_topic, self.request, self.profile, extra)

    @property
    def qos(self) -> dict[str, Any]:
        found: dict[str, Any] = self.profile.get_c_qos_profile().to_dict()
        return found

    def service_take_request(self, message: Any) -> tuple[Any, rmw_service_info_t | None]:
        taken = self._take(message, None)
        if taken is None:
            return None, None
        info, request = taken
        asked = info.request_id
        self._events.publish(REQUEST_RECEIVED, asked.client, asked.sequence_number, request=request)
        return request, info

    def service_send_response(self, response: Any, header: rmw_request_id_t) -> None:
        self._wait_for_reader(header.publication_handle)
        data = _with_header(header.client, header.sequence_number, rclpy_serialize(response, self.response))
        self.writer.write(data)
        self._events.publish(RESPONSE_SENT, header.client, header.sequence_number, response=response)

    def _wait_for_reader(self, publication_handle: int) -> None:
        """Wait until the client of a request would hear the response, as rmw does: at most 0.1 s."""
        data = self.reader.user_data_of(publication_handle)
        client = "" if data is None else user_data_value(data, "clientid")
        deadline = time.monotonic() + _FOR_READER
        while (
            client
            and all(user_data_value(each, "clientid") != client for each in self.writer.matched_user_data())
            and time.monotonic() < deadline
        ):
            time.sleep(_BETWEEN_LOOKS)


class TypeDescriptionService(Destroyable):
    def __init__(self, node: Node) -> None:
        super().__init__()
        from type_description_interfaces.srv import GetTypeDescription

        qos = predefined("qos_profile_services_default")
        self.impl = Service(node, GetTypeDescription, "~/get_type_description", qos)

    def handle_request(self, request: Any, response_type: Any, node: Node) -> Any:
        """Answer as rcl does: the hash identifies the type, which must be in use; its name is ignored."""
        if not _HASH.fullmatch(request.type_hash):
            return response_type(failure_reason="Failed to parse type hash")
        found = node.types.get(request.type_hash)
        if found is None:
            return response_type(failure_reason="Type not currently in use by this node")
        response = response_type(successful=True, type_description=found.description())
        if request.include_type_sources:
            response.type_sources = found.sources()
        return response

    def destroy(self) -> None:
        self.impl.destroy_when_not_in_use()
