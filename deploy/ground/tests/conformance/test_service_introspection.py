"""Service introspection: the events of a service and of a client."""

from __future__ import annotations

from typing import Any

import pytest
from deploy.ground.tests.nodes import MakeNode, SpinUntil
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

OFF = ServiceIntrospectionState.OFF
METADATA = ServiceIntrospectionState.METADATA
CONTENTS = ServiceIntrospectionState.CONTENTS


def negate(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
    response.success = not request.data
    return response


class Introspected:
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
        self.events.clear()
        future = self.client.call_async(SetBool.Request(data=True))
        self._spin_until(lambda: future.done() and len(self.events) == 4)
        return sorted(self.events, key=lambda event: event.info.event_type)


@pytest.fixture
def introspected(
    make_node: MakeNode, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> Introspected:
    node = make_node()
    executor.add_node(node)
    return Introspected(node, spin_until)


def test_contents_publishes_requests_and_responses_of_both_sides(introspected: Introspected) -> None:
    introspected.configure(CONTENTS)
    before = introspected.node.get_clock().now()
    events = introspected.call()
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


def test_both_events_of_a_side_carry_the_same_client_gid(introspected: Introspected) -> None:
    introspected.configure(METADATA)
    sent, received, answered, done = (bytes(event.info.client_gid) for event in introspected.call())
    (client,) = introspected.node.get_publishers_info_by_topic("rq/negateRequest", no_mangle=True)
    assert sent == done
    assert sent[:12] == bytes(client.endpoint_gid)[:12]  # the prefix of its participant
    assert received == answered


def test_changing_the_state_and_destroying_leaves_no_publisher(
    introspected: Introspected, spin_until: SpinUntil
) -> None:
    introspected.configure(CONTENTS)
    introspected.configure(METADATA)
    assert not any(event.request for event in introspected.call())
    introspected.configure(OFF)
    introspected.configure(OFF)
    introspected.configure(CONTENTS, qos_profile_system_default)
    introspected.node.destroy_service(introspected.service)
    introspected.node.destroy_client(introspected.client)
    spin_until(lambda: introspected.node.count_publishers("negate/_service_event") == 0)


@pytest.mark.parametrize("side", ["service", "client"])
def test_a_destroyed_service_or_client_cannot_be_introspected(introspected: Introspected, side: str) -> None:
    destroyed: Any = getattr(introspected, side)
    destroyed.destroy()
    with pytest.raises(InvalidHandle):
        destroyed.configure_introspection(introspected.node.get_clock(), QoSProfile(depth=1), METADATA)
