"""A smoke test of ROS 2 Kilted's rclpy with Jazzy's and on Cyclone DDS; needs KILTED_PYTHON."""

from __future__ import annotations

from typing import Any

import pytest
from deploy.ground.tests.host import wait_until
from deploy.ground.tests.interop.conftest import PeerOn

POSITION = "geometry_msgs/msg/PointStamped"


def without_nodes(endpoints: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Kilted names no nodes for endpoints on Cyclone DDS, which does not announce their participant."""
    return [{**endpoint, "node": ""} for endpoint in endpoints]


@pytest.mark.parametrize("other_rclpy", ["cyclonedds", "jazzy"])
def test_topics_connect_kilted_with_other_nodes(other_rclpy: str, peer_on: PeerOn) -> None:
    kilted, other = peer_on("kilted"), peer_on(other_rclpy)
    qos = {"depth": 1, "durability": "TRANSIENT_LOCAL"}
    for node, reader in ((kilted, other), (other, kilted)):
        topic = f"{node.namespace}/to{reader.namespace}"
        message = (
            "geometry_msgs.msg.PointStamped("
            "header=std_msgs.msg.Header("
            "stamp=builtin_interfaces.msg.Time(sec=1, nanosec=2), frame_id='base'), "
            f"point=geometry_msgs.msg.Point(x=1.5, y={float(len(topic))}, z=0.0))"
        )
        node("advertise", topic, POSITION, qos)
        node("publish", topic, message)
        reader("subscribe", topic, POSITION, qos)
        wait_until(lambda: reader("received", topic))  # noqa: B023
        assert reader("received", topic) == [message]
        wait_until(lambda: len(node("endpoints", topic)) == len(reader("endpoints", topic)) == 2)  # noqa: B023
        assert without_nodes(reader("endpoints", topic)) == without_nodes(node("endpoints", topic))
        # What a node publishes is announced apart from its endpoints.
        wait_until(lambda: node.full_name in reader("nodes"))  # noqa: B023
        wait_until(lambda: topic in reader("interface", node.name, node.namespace)["publishers"])  # noqa: B023
        interface = reader("interface", node.name, node.namespace)
        assert interface["publishers"][topic] == [POSITION]


@pytest.mark.parametrize(("serving", "calling"), [("jazzy", "kilted"), ("kilted", "jazzy")])
def test_services_parameters_and_actions_connect_kilted_with_jazzy(
    serving: str, calling: str, peer_on: PeerOn
) -> None:
    server, client, service = peer_on(serving), peer_on(calling), f"/called_by_{calling}"
    server("serve", service)
    server("declare", "limit", 1.0)
    wait_until(lambda: client("find", service))
    assert client("call", service, True) == (
        f"std_srvs.srv.SetBool_Response(success=True, message='{server.name}')"
    )
    assert client("set", server.full_name, "limit", 2.0) == {
        "successful": True,
        "names": ["limit"],
        "description": ["limit", 3],  # of type double
        "value": 2.0,
    }
    server("serve_action", f"{service}/fibonacci")
    assert client("reach", f"{service}/fibonacci", 7) == [7]
