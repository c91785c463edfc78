"""How service events name the client."""

from __future__ import annotations

from collections.abc import Callable

from rclpy._dds.discovery import Discovery
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service_introspection import ServiceIntrospectionState
from std_srvs.srv import SetBool


def test_a_client_is_named_by_the_identifier_it_announces_and_in_a_server_by_its_requests(
    spin_until: Callable[..., None], node: Node
) -> None:
    service = node.create_service(SetBool, "negate", lambda request, response: response)
    client = node.create_client(SetBool, "negate")
    events: list[SetBool.Event] = []
    node.create_subscription(SetBool.Event, "negate/_service_event", events.append, 10)
    metadata = ServiceIntrospectionState.METADATA
    service.configure_introspection(node.get_clock(), QoSProfile(depth=10), metadata)
    client.configure_introspection(node.get_clock(), QoSProfile(depth=10), metadata)
    assert client.wait_for_service(10.0)
    client.call_async(SetBool.Request())
    spin_until(lambda: len(events) == 4)
    events.sort(key=lambda event: event.info.event_type)
    sent, received, answered, done = (bytes(event.info.client_gid) for event in events)

    (announced,) = (
        endpoint.user_data
        for endpoint in Discovery(node._rclpy_graph.participant.handle).writers()
        if endpoint.topic == "rq/negateRequest"
    )
    identifier = ".".join(f"{octet:x}" for octet in sent)
    assert announced.startswith(f"clientid= {identifier};")
    assert sent == done
    # in one process, the client's handle and the handle of its requests are the same
    assert received == answered == 2 * client.handle.instance_handle.to_bytes(8, "little")
