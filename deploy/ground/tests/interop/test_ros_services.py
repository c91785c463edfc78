"""Services between nodes on Cyclone DDS and nodes on ROS 2's own middleware.

ROS 2 has no common form of requests: its middlewares for Cyclone DDS and for Fast DDS cannot call each other
(ros2/rmw_cyclonedds#184). The tests show that a call is refused with a reason and does no harm. Parameters
and actions consist of services, so the same is true of them; what is left are the topics of actions.
"""

from __future__ import annotations

from concurrent.futures import TimeoutError as NoAnswer

from action_msgs.msg import GoalStatus
from deploy.ground.tests.host import wait_until
from deploy.ground.tests.interop.conftest import PeerOn


def test_a_server_of_ros_is_not_called_but_named(peer_on: PeerOn) -> None:
    server, client = peer_on("jazzy"), peer_on("cyclonedds")
    server("serve", "/switch")
    client("find", "/switch")

    def is_refused() -> bool:
        try:
            client.begin("call", "/switch", True).result(0.5)  # without a server, it waits
        except NoAnswer:
            return False
        except RuntimeError as error:
            return "did not call /switch: a server is on another DDS" in str(error)
        return False

    wait_until(is_refused)
    assert server("calls") == []
    assert not client("find", "/switch")


def test_a_client_of_ros_is_not_served(peer_on: PeerOn) -> None:
    server, client = peer_on("cyclonedds"), peer_on("jazzy")
    server("serve", "/lever")
    wait_until(lambda: client("find", "/lever"))
    client.begin("call", "/lever", True)  # gets no answer
    wait_until(lambda: server("find", "/lever"))
    assert "success=False" in server("call", "/lever", False)
    assert server("calls") == [False]


def test_node_of_ros_sees_an_action_and_its_goals(peer_on: PeerOn) -> None:
    watching, acting = peer_on("jazzy"), peer_on("cyclonedds")
    acting("serve_action", "/fibonacci")
    assert acting("reach", "/fibonacci", 7) == [7]
    status = {"depth": 1, "durability": "TRANSIENT_LOCAL"}
    watching("subscribe", "/fibonacci/_action/status", "action_msgs/msg/GoalStatusArray", status)
    wait_until(lambda: watching("received", "/fibonacci/_action/status"))
    assert f"status={GoalStatus.STATUS_SUCCEEDED})" in watching("received", "/fibonacci/_action/status")[-1]
    (types,) = watching("actions").values()
    assert types[0].endswith("/action/Fibonacci")
