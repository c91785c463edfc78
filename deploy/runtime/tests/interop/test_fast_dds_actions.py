"""Actions against the DDS of a second vendor: every byte of the peer follows the definition of the action."""

from __future__ import annotations

import struct
from collections.abc import Callable

import pytest
from deploy.runtime.tests.interop.conftest import FastPeer

from action_msgs.msg import GoalStatus
from example_interfaces.action import Fibonacci
from rclpy.action import ActionClient, ActionServer
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from unique_identifier_msgs.msg import UUID

pytestmark = pytest.mark.timeout(300)  # the first test builds the peer

SpinUntil = Callable[[Callable[[], object]], None]

FIBONACCI = "example_interfaces::action::dds_::Fibonacci_"
STATUS = "action_msgs::msg::dds_::GoalStatusArray_"
ENCAPSULATION = b"\0\1\0\0"
HEADER = bytes(range(16))  # the identity of a client and a sequence number
GOAL = bytes(range(100, 116))
SUCCEEDED = struct.pack("<b3x", GoalStatus.STATUS_SUCCEEDED)


def int32(*numbers: int) -> bytes:
    """Integers without the length of a sequence."""
    return struct.pack(f"<{len(numbers)}i", *numbers)


def matched(peer: FastPeer, kind: str, topic: str) -> bool:
    return peer.has_reported("matched", kind, topic, "1")


def test_a_fast_dds_client_sends_a_goal_to_a_node(peer: FastPeer, node: Node, spin_until: SpinUntil) -> None:
    def execute(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
        goal_handle.publish_feedback(Fibonacci.Feedback(sequence=[goal_handle.request.order]))
        goal_handle.succeed()
        return Fibonacci.Result(sequence=[1, 2])

    server = ActionServer(node, Fibonacci, "fibonacci", execute)
    topic = "fibonacci/_action"
    peer.create("reader", f"rt/{topic}/feedback", f"{FIBONACCI}FeedbackMessage_")
    peer.create("reader", f"rt/{topic}/status", STATUS, durability="transient_local")
    for service, type_name in (("send_goal", "SendGoal"), ("get_result", "GetResult")):
        reply, request = f"rr/{topic}/{service}Reply", f"rq/{topic}/{service}Request"
        identity = f"clientid={len(service)};"
        peer.create("reader", reply, f"{FIBONACCI}{type_name}_Response_", user_data=identity)
        peer.create("writer", request, f"{FIBONACCI}{type_name}_Request_", user_data=identity)
        spin_until(lambda: matched(peer, "reader", reply) and matched(peer, "writer", request))  # noqa: B023
    spin_until(lambda: matched(peer, "reader", f"rt/{topic}/feedback"))

    def is_answered(service: str, request: bytes) -> bool:
        if peer.samples(f"rr/{topic}/{service}Reply"):
            return True
        # Repeat the request: the node may not have discovered the peer's writer yet.
        peer.send(f"rq/{topic}/{service}Request", ENCAPSULATION + HEADER + request)
        return False

    spin_until(lambda: is_answered("send_goal", GOAL + int32(7)))
    accepted = peer.samples(f"rr/{topic}/send_goalReply")[0]
    assert accepted[:24] == ENCAPSULATION + HEADER + b"\1\0\0\0"
    stamp = accepted[24:32]
    spin_until(lambda: is_answered("get_result", GOAL))
    result = ENCAPSULATION + HEADER + SUCCEEDED + int32(2, 1, 2)
    assert set(peer.samples(f"rr/{topic}/get_resultReply")) == {result}
    assert peer.samples(f"rt/{topic}/feedback") == [ENCAPSULATION + GOAL + int32(1, 7)]
    status = ENCAPSULATION + int32(1) + GOAL + stamp + SUCCEEDED
    spin_until(lambda: peer.samples(f"rt/{topic}/status")[-1:] == [status])
    server.destroy()


def test_a_node_sends_a_goal_to_a_fast_dds_server(peer: FastPeer, node: Node, spin_until: SpinUntil) -> None:
    topic = "fibonacci/_action"
    peer.create("writer", f"rt/{topic}/feedback", f"{FIBONACCI}FeedbackMessage_")
    peer.create("writer", f"rt/{topic}/status", STATUS, durability="transient_local")
    services = {
        "send_goal": f"{FIBONACCI}SendGoal",
        "get_result": f"{FIBONACCI}GetResult",
        "cancel_goal": "action_msgs::srv::dds_::CancelGoal",
    }
    for service, type_name in services.items():
        identity = f"serviceid={len(service)};"
        peer.create("reader", f"rq/{topic}/{service}Request", f"{type_name}_Request_", user_data=identity)
        peer.create("writer", f"rr/{topic}/{service}Reply", f"{type_name}_Response_", user_data=identity)
    client = ActionClient(node, Fibonacci, "fibonacci")
    spin_until(
        lambda: (
            client.server_is_ready()
            and matched(peer, "writer", f"rt/{topic}/feedback")
            and all(
                matched(peer, "reader", f"rq/{topic}/{service}Request")
                and matched(peer, "writer", f"rr/{topic}/{service}Reply")
                for service in services
            )
        )
    )
    heard: list[list[int]] = []
    sent = client.send_goal_async(
        Fibonacci.Goal(order=7),
        lambda message: heard.append(list(message.feedback.sequence)),
        UUID(uuid=list(GOAL)),
    )

    def answer(service: str, reply: bytes) -> bytes:
        """Answer the request of a service; return the request."""
        spin_until(lambda: peer.samples(f"rq/{topic}/{service}Request"))
        request = peer.samples(f"rq/{topic}/{service}Request")[0]
        peer.send(f"rr/{topic}/{service}Reply", request[:20] + reply)
        return request[20:]

    assert answer("send_goal", b"\1\0\0\0" + int32(5, 6)) == GOAL + int32(7)
    spin_until(sent.done)
    goal_handle = sent.result()
    assert (goal_handle.accepted, goal_handle.stamp.sec, goal_handle.stamp.nanosec) == (True, 5, 6)
    peer.send(f"rt/{topic}/feedback", ENCAPSULATION + GOAL + int32(2, 8, 9))
    spin_until(lambda: heard)
    assert heard == [[8, 9]]
    cancelled = goal_handle.cancel_goal_async()
    assert answer("cancel_goal", b"\2\0\0\0" + int32(0)) == GOAL + int32(0, 0)
    spin_until(cancelled.done)
    assert (cancelled.result().return_code, cancelled.result().goals_canceling) == (2, [])
    result = goal_handle.get_result_async()
    assert answer("get_result", SUCCEEDED + int32(1, 4)) == GOAL
    peer.send(f"rt/{topic}/status", ENCAPSULATION + int32(1) + GOAL + int32(5, 6) + SUCCEEDED)
    spin_until(lambda: result.done() and goal_handle.status == GoalStatus.STATUS_SUCCEEDED)
    assert list(result.result().result.sequence) == [4]
    client.destroy()
