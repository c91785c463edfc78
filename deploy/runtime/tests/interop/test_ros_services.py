"""Services between nodes on the embedded rclpy and nodes on ROS 2's own.

ROS 2 has no common form of requests: its middlewares for Cyclone DDS and for Fast DDS cannot call each other
(ros2/rmw_cyclonedds#184). The tests show that a call is refused with a reason and does no harm. Parameters
and actions consist of services, so the same is true of them; what is left are the topics of actions.
"""

from __future__ import annotations

import pytest
from deploy.runtime.tests.host import wait_until
from deploy.runtime.tests.interop.conftest import PeerOn
from deploy.runtime.tests.interop.processes import PAIRS

from action_msgs.msg import GoalStatus

LOG = "rcl_interfaces/msg/Log"


@pytest.mark.parametrize(("serving", "calling"), PAIRS)
def test_call_between_the_runtimes_is_refused(serving: str, calling: str, peer_on: PeerOn) -> None:
    server, client, service = peer_on(serving), peer_on(calling), f"/called_by_{calling}"
    server("serve", service)
    client("subscribe", "/rosout", LOG, {"depth": 100})
    reason = (
        f"did not call {service}" if calling == "embedded" else f"on {service}: its client is on another DDS"
    )

    def is_refused() -> bool:
        client("find", service)
        client.begin("call", service, True)  # without effect until both have found each other
        return any(reason in message for message in client("received", "/rosout"))

    wait_until(is_refused)
    assert server("calls") == []


def test_embedded_client_finds_no_server_of_ros(peer_on: PeerOn) -> None:
    server, client = peer_on("jazzy"), peer_on("embedded")
    server("serve", "/switch")
    wait_until(lambda: "/switch" in client("graph")["services"])
    assert not client("find", "/switch")


def test_node_of_ros_sees_an_embedded_action_and_its_goals(peer_on: PeerOn) -> None:
    watching, acting = peer_on("jazzy"), peer_on("embedded")
    acting("serve_action", "/fibonacci")
    assert acting("reach", "/fibonacci", 7) == [7]
    status = {"depth": 1, "durability": "TRANSIENT_LOCAL"}
    watching("subscribe", "/fibonacci/_action/status", "action_msgs/msg/GoalStatusArray", status)
    wait_until(lambda: watching("received", "/fibonacci/_action/status"))
    assert f"status={GoalStatus.STATUS_SUCCEEDED})" in watching("received", "/fibonacci/_action/status")[-1]
    assert watching("actions") == {"/fibonacci": ["example_interfaces/action/Fibonacci"]}
