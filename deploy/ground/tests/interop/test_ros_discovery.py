"""Which nodes of a host meet across Cyclone DDS and Fast DDS, by their discovery ranges."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from deploy.ground.tests.host import RANGE, Host, wait_until
from deploy.ground.tests.interop.processes import PAIRS, PeerProcess

Start = Callable[..., PeerProcess]

pytestmark = pytest.mark.parametrize(("first", "second"), PAIRS)


@pytest.fixture
def start(host_with_network: Host) -> Iterator[Start]:
    """Starts nodes on the host; ``start(rclpy, name, discovery_range)``."""
    with ExitStack() as stack:

        def start(rclpy: str, name: str, discovery_range: str) -> PeerProcess:
            environment = {"ROS_DOMAIN_ID": "0", RANGE: discovery_range}
            node = PeerProcess(rclpy, environment, name, host_with_network.enter)
            stack.enter_context(node)
            node("nodes")  # it has started
            return node

        yield start


@pytest.mark.parametrize(
    "ranges",
    [("LOCALHOST", "LOCALHOST"), ("LOCALHOST", "SUBNET"), ("SUBNET", "LOCALHOST"), ("SUBNET", "SUBNET")],
    ids=" and ".join,
)
def test_nodes_of_a_host_meet(ranges: tuple[str, str], first: str, second: str, start: Start) -> None:
    nodes = start(first, "first", ranges[0]), start(second, "second", ranges[1])
    for node in nodes:
        node("advertise", f"/{node.name}", "std_msgs/msg/String", {"depth": 1})
    for node, other in (nodes, nodes[::-1]):
        other("subscribe", f"/{node.name}", "std_msgs/msg/String", {"depth": 1})
        wait_until(lambda: node("readers", f"/{node.name}") and other("writers", f"/{node.name}"))  # noqa: B023
        node("publish", f"/{node.name}", "std_msgs.msg.String(data='hello')")
        wait_until(lambda: other("received", f"/{node.name}"))  # noqa: B023


@pytest.mark.parametrize("discovery_range", ["LOCALHOST", "SUBNET"])
def test_node_in_range_off_meets_no_other(
    discovery_range: str, first: str, second: str, start: Start
) -> None:
    hidden, node = start(first, "hidden", "OFF"), start(second, "node", discovery_range)
    witness = start(first, "witness", discovery_range)  # as the hidden one, but for the range
    wait_until(lambda: witness.full_name in node("nodes"))
    assert hidden.full_name not in node("nodes")
    assert hidden("nodes") == [hidden.full_name]
