from __future__ import annotations

from deploy.runtime.tests.nodes import SpinUntil

from rclpy._dds.discovery import Discovery
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.service_introspection import ServiceIntrospectionState
from std_srvs.srv import SetBool


def test_events_name_a_client_by_its_announced_id_or_its_writer(spin_until: SpinUntil, node: Node) -> None:
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
    # within one process, the instance handles of the client and of its requests are equal
    assert received == answered == 2 * client.handle.instance_handle.to_bytes(8, "little")
