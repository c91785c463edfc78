"""Service introspection: what others can see of the calls of a service and a client."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rclpy.client import Client
from rclpy.exceptions import InvalidHandle
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_system_default
from rclpy.service import Service
from rclpy.service_introspection import ServiceIntrospectionState
from rclpy.time import Time
from service_msgs.msg import ServiceEventInfo
from std_srvs.srv import SetBool

SpinUntil = Callable[..., None]
OFF = ServiceIntrospectionState.OFF
METADATA = ServiceIntrospectionState.METADATA
CONTENTS = ServiceIntrospectionState.CONTENTS


def negate(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
    response.success = not request.data
    return response


class Watched:
    """A service, its client, and the events of both."""

    def __init__(self, node: Node, spin_until: SpinUntil) -> None:
        self.node = node
        self.service: Service = node.create_service(SetBool, "negate", negate)
        self.client: Client = node.create_client(SetBool, "negate")
        self.events: list[SetBool.Event] = []
        node.create_subscription(SetBool.Event, "negate/_service_event", self.events.append, 10)
        self._spin_until = spin_until
        assert self.client.wait_for_service(10.0)

    def configure(self, state: ServiceIntrospectionState, profile: QoSProfile | None = None) -> None:
        profile = profile or QoSProfile(depth=10)
        for side in (self.service, self.client):
            side.configure_introspection(self.node.get_clock(), profile, state)
        publishers = 0 if state is OFF else 2
        self._spin_until(lambda: self.node.count_publishers("negate/_service_event") == publishers)

    def call(self) -> list[SetBool.Event]:
        """The events of a call, in the order of their types."""
        self.events.clear()
        future = self.client.call_async(SetBool.Request(data=True))
        self._spin_until(lambda: future.done() and len(self.events) == 4)
        return sorted(self.events, key=lambda event: event.info.event_type)


@pytest.fixture
def watched(
    make_node: Callable[..., Node], executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> Watched:
    node = make_node()
    executor.add_node(node)
    return Watched(node, spin_until)


def test_contents_tells_both_sides_of_a_call_with_request_and_response(watched: Watched) -> None:
    watched.configure(CONTENTS)
    before = watched.node.get_clock().now()
    events = watched.call()
    request, response = SetBool.Request(data=True), SetBool.Response(success=False)
    assert [(event.info.event_type, event.request, event.response) for event in events] == [
        (ServiceEventInfo.REQUEST_SENT, [request], []),
        (ServiceEventInfo.REQUEST_RECEIVED, [request], []),
        (ServiceEventInfo.RESPONSE_SENT, [], [response]),
        (ServiceEventInfo.RESPONSE_RECEIVED, [], [response]),
    ]
    assert len({event.info.sequence_number for event in events}) == 1
    times = [Time.from_msg(event.info.stamp, before.clock_type) for event in events]
    assert before <= times[0]
    assert times == sorted(times)


def test_each_side_names_the_client_alike_before_and_after(watched: Watched) -> None:
    watched.configure(METADATA)
    sent, received, answered, done = (bytes(event.info.client_gid) for event in watched.call())
    (client,) = watched.node.get_publishers_info_by_topic("rq/negateRequest", no_mangle=True)
    assert sent == done
    assert sent[:12] == bytes(client.endpoint_gid)[:12]  # its participant's
    assert received == answered


def test_metadata_keeps_requests_and_responses_to_itself(watched: Watched) -> None:
    watched.configure(METADATA)
    assert all(event.request == event.response == [] for event in watched.call())


def test_the_state_changes_and_ends_without_a_trace(watched: Watched) -> None:
    watched.configure(CONTENTS)
    watched.configure(METADATA)
    assert not any(event.request for event in watched.call())
    watched.configure(OFF)
    watched.configure(OFF)
    watched.configure(CONTENTS, qos_profile_system_default)
    watched.node.destroy_service(watched.service)
    watched.node.destroy_client(watched.client)
    assert watched.node.count_publishers("negate/_service_event") == 0


def test_the_events_publisher_is_not_one_of_the_nodes(watched: Watched) -> None:
    before = list(watched.node.publishers)
    watched.configure(METADATA)
    assert list(watched.node.publishers) == before


@pytest.mark.parametrize("side", ["service", "client"])
def test_what_was_destroyed_cannot_be_watched(watched: Watched, side: str) -> None:
    destroyed: Any = getattr(watched, side)
    destroyed.destroy()
    with pytest.raises(InvalidHandle):
        destroyed.configure_introspection(watched.node.get_clock(), QoSProfile(depth=1), METADATA)
