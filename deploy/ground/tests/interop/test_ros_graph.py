"""What nodes on rclpy on Cyclone DDS and nodes on ROS 2's own know of each other."""

from __future__ import annotations

import pytest
from deploy.ground.tests.host import wait_until
from deploy.ground.tests.interop.conftest import PeerOn, StartPeer
from deploy.ground.tests.interop.processes import PAIRS, WITHOUT_SHARED_MEMORY

FLOAT64, POSITION = "std_msgs/msg/Float64", "geometry_msgs/msg/PointStamped"
PARAMETER_SERVICES = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
)

pytestmark = pytest.mark.parametrize(("watched", "watching"), PAIRS)


def test_nodes_know_names_and_types_of_each_other(
    watched: str, watching: str, peer_on: PeerOn, topic: str
) -> None:
    node, other = peer_on(watched), peer_on(watching)
    node("advertise", topic, FLOAT64, {"depth": 1})
    node("subscribe", "heard", POSITION, {"depth": 1})  # in the namespace of the node
    node("serve", "switch")
    heard, switch = f"{node.namespace}/heard", f"{node.namespace}/switch"
    wait_until(lambda: {node.full_name, other.full_name} <= set(other("nodes")))
    wait_until(
        lambda: other("interface", node.name, node.namespace) == node("interface", node.name, node.namespace)
    )
    interface = other("interface", node.name, node.namespace)
    assert interface["publishers"][topic] == [FLOAT64]
    assert interface["publishers"]["/rosout"] == ["rcl_interfaces/msg/Log"]
    assert interface["subscriptions"][heard] == [POSITION]
    assert interface["services"][switch] == ["std_srvs/srv/SetBool"]
    assert {f"{node.full_name}/{name}" for name in PARAMETER_SERVICES} <= set(interface["services"])
    graph = other("graph")
    assert graph["topics"][topic] == [FLOAT64]
    assert graph["topics"][heard] == [POSITION]
    assert graph["services"][switch] == ["std_srvs/srv/SetBool"]
    wait_until(lambda: other("graph") == node("graph"))


def test_nodes_know_the_endpoints_of_each_other(
    watched: str, watching: str, peer_on: PeerOn, topic: str
) -> None:
    node, other = peer_on(watched), peer_on(watching)
    qos = {"depth": 1, "durability": "TRANSIENT_LOCAL", "lifespan": 0.4}
    node("advertise", topic, POSITION, qos)
    node("subscribe", topic, POSITION, {"depth": 1, "reliability": "BEST_EFFORT"})
    wait_until(lambda: len(node("endpoints", topic)) == 2)
    wait_until(lambda: other("endpoints", topic) == node("endpoints", topic))
    publisher, subscription = other("endpoints", topic)
    assert publisher["node"] == subscription["node"] == node.full_name
    assert publisher["hash"].startswith("RIHS01_")
    assert (publisher["lifespan"], publisher["durability"]) == (400_000_000, "TRANSIENT_LOCAL")
    assert subscription["reliability"] == "BEST_EFFORT"


def test_type_has_the_same_hash_on_each_rclpy(
    watched: str, watching: str, peer_on: PeerOn, topic: str
) -> None:
    node, other = peer_on(watched), peer_on(watching)
    node("advertise", topic, "diagnostic_msgs/msg/DiagnosticArray", {"depth": 1})
    other("advertise", topic, "diagnostic_msgs/msg/DiagnosticArray", {"depth": 1})
    names = {node.full_name, other.full_name}
    wait_until(lambda: {publisher["node"] for publisher in other("endpoints", topic)} == names)
    first, second = other("endpoints", topic)
    assert first["hash"] == second["hash"] != "INVALID"


def test_killed_node_leaves_the_graph_of_the_other(
    watched: str, watching: str, peer_on: PeerOn, start_peer: StartPeer, topic: str
) -> None:
    node = start_peer(watched, "killed", **WITHOUT_SHARED_MEMORY.get(watched, {}))
    other = peer_on(watching)
    other("subscribe", topic, FLOAT64, {"depth": 1})
    node("advertise", topic, FLOAT64, {"depth": 1})
    wait_until(lambda: other("writers", topic) == 1 and node.full_name in other("nodes"))
    node.kill()
    wait_until(lambda: other("writers", topic) == 0, seconds=60)
    wait_until(lambda: node.full_name not in other("nodes"))
    assert node.full_name not in " ".join(other("graph")["services"])
