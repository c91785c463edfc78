"""Services and actions against plain DDS endpoints: every byte follows rmw_cyclonedds and the definitions.

There is one topic in each direction. A sample begins with the identity of the client and a sequence number;
USER_DATA pairs a reader with its writer.
"""

from __future__ import annotations

import struct

import pytest
from deploy.runtime.tests.nodes import SpinUntil

from action_msgs.msg import GoalStatus
from example_interfaces.action import Fibonacci
from rclpy._dds import Participant, Reader, Writer
from rclpy.action import ActionClient, ActionServer
from rclpy.action.server import ServerGoalHandle
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import SetBool
from unique_identifier_msgs.msg import UUID

SET_BOOL = "std_srvs::srv::dds_::SetBool"
FIBONACCI = "example_interfaces::action::dds_::Fibonacci_"
STATUS = "action_msgs::msg::dds_::GoalStatusArray_"
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ENCAPSULATION = b"\0\1\0\0"
HEADER = bytes(range(16))  # the identity of a client and a sequence number
GOAL = bytes(range(100, 116))
SUCCEEDED = struct.pack("<b3x", GoalStatus.STATUS_SUCCEEDED)


def int32(*numbers: int) -> bytes:
    """Integers without the length of a sequence."""
    return struct.pack(f"<{len(numbers)}i", *numbers)


class Peer:
    """DDS readers and writers by their topics, with the samples that have arrived."""

    def __init__(self, participant: Participant, spin_until: SpinUntil) -> None:
        self._participant = participant
        self._spin_until = spin_until
        self._readers: dict[str, Reader] = {}
        self._writers: dict[str, Writer] = {}
        self._samples: dict[str, list[bytes]] = {}

    def read(self, topic: str, type_name: str, user_data: str = "") -> None:
        qos = LATCHED if type_name == STATUS else QoSProfile(depth=10)
        self._readers[topic] = self._participant.create_reader(topic, type_name, qos, user_data)

    def write(self, topic: str, type_name: str, user_data: str = "") -> None:
        self._writers[topic] = self._participant.create_writer(topic, type_name, LATCHED, user_data)

    def call(self, service: str, type_name: str) -> None:
        self.read(f"rr/{service}Reply", f"{type_name}_Response_", f"clientid={len(service)};")
        self.write(f"rq/{service}Request", f"{type_name}_Request_", f"clientid={len(service)};")

    def serve(self, service: str, type_name: str) -> None:
        self.read(f"rq/{service}Request", f"{type_name}_Request_", f"serviceid={len(service)};")
        self.write(f"rr/{service}Reply", f"{type_name}_Response_", f"serviceid={len(service)};")

    def match(self) -> None:
        self._spin_until(
            lambda: all(each.matched() for each in (*self._readers.values(), *self._writers.values()))
        )

    def send(self, topic: str, data: bytes) -> None:
        self._writers[topic].write(ENCAPSULATION + data)

    def received(self, topic: str) -> bytes:
        """Wait for a sample; return it without encapsulation."""
        samples: list[bytes] = []

        def has_come() -> bool:
            if (sample := self._readers[topic].take()) is not None:
                assert sample.data[:4] == ENCAPSULATION
                samples.append(sample.data[4:])
            return bool(samples)

        self._spin_until(has_come)
        return samples[0]

    def ask(self, service: str, request: bytes) -> bytes:
        """Call a service; return the reply."""
        self.send(f"rq/{service}Request", HEADER + request)
        reply = self.received(f"rr/{service}Reply")
        assert reply[:16] == HEADER
        return reply[16:]

    def answer(self, service: str, reply: bytes) -> bytes:
        """Answer the next request of a service; return the request."""
        request = self.received(f"rq/{service}Request")
        self.send(f"rr/{service}Reply", request[:16] + reply)
        return request[16:]


@pytest.fixture
def peer(participant: Participant, spin_until: SpinUntil) -> Peer:
    return Peer(participant, spin_until)


def test_client_calls_a_service_of_a_node(peer: Peer, node: Node) -> None:
    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success, response.message = request.data, "ok"
        return response

    node.create_service(SetBool, "switch", answer)
    peer.call("switch", SET_BOOL)
    peer.match()
    assert peer.ask("switch", b"\1") == b"\1\0\0\0" + b"\3\0\0\0ok\0" + b"\0"  # padded


def test_node_calls_a_service(peer: Peer, node: Node, spin_until: SpinUntil) -> None:
    peer.serve("switch", SET_BOOL)
    client = node.create_client(SetBool, "switch")
    peer.match()
    spin_until(client.service_is_ready)
    future = client.call_async(SetBool.Request(data=True))
    assert peer.answer("switch", b"\1\0\0\0" + b"\3\0\0\0ok\0")[:1] == b"\1"
    spin_until(future.done)
    assert future.result() == SetBool.Response(success=True, message="ok")


def test_client_sends_a_goal_to_a_node(peer: Peer, node: Node) -> None:
    def execute(goal_handle: ServerGoalHandle) -> Fibonacci.Result:
        goal_handle.publish_feedback(Fibonacci.Feedback(sequence=[goal_handle.request.order]))
        goal_handle.succeed()
        return Fibonacci.Result(sequence=[1, 2])

    server = ActionServer(node, Fibonacci, "fibonacci", execute)
    topic = "fibonacci/_action"
    peer.read(f"rt/{topic}/feedback", f"{FIBONACCI}FeedbackMessage_")
    peer.read(f"rt/{topic}/status", STATUS)
    peer.call(f"{topic}/send_goal", f"{FIBONACCI}SendGoal")
    peer.call(f"{topic}/get_result", f"{FIBONACCI}GetResult")
    peer.match()
    accepted = peer.ask(f"{topic}/send_goal", GOAL + int32(7))
    assert accepted[:4] == b"\1\0\0\0"
    stamp = accepted[4:12]
    assert peer.ask(f"{topic}/get_result", GOAL) == SUCCEEDED + int32(2, 1, 2)
    assert peer.received(f"rt/{topic}/feedback") == GOAL + int32(1, 7)
    while peer.received(f"rt/{topic}/status") != int32(1) + GOAL + stamp + SUCCEEDED:
        pass  # what the goal was before
    server.destroy()


def test_node_sends_a_goal_to_a_server(peer: Peer, node: Node, spin_until: SpinUntil) -> None:
    topic = "fibonacci/_action"
    peer.write(f"rt/{topic}/feedback", f"{FIBONACCI}FeedbackMessage_")
    peer.write(f"rt/{topic}/status", STATUS)
    peer.serve(f"{topic}/send_goal", f"{FIBONACCI}SendGoal")
    peer.serve(f"{topic}/get_result", f"{FIBONACCI}GetResult")
    peer.serve(f"{topic}/cancel_goal", "action_msgs::srv::dds_::CancelGoal")
    client = ActionClient(node, Fibonacci, "fibonacci")
    peer.match()
    spin_until(client.server_is_ready)
    heard: list[list[int]] = []
    sent = client.send_goal_async(
        Fibonacci.Goal(order=7),
        lambda message: heard.append(list(message.feedback.sequence)),
        UUID(uuid=list(GOAL)),
    )
    assert peer.answer(f"{topic}/send_goal", b"\1\0\0\0" + int32(5, 6)) == GOAL + int32(7)
    spin_until(sent.done)
    goal_handle = sent.result()
    assert (goal_handle.accepted, goal_handle.stamp.sec, goal_handle.stamp.nanosec) == (True, 5, 6)
    peer.send(f"rt/{topic}/feedback", GOAL + int32(2, 8, 9))
    spin_until(lambda: heard)
    assert heard == [[8, 9]]
    cancelled = goal_handle.cancel_goal_async()
    assert peer.answer(f"{topic}/cancel_goal", b"\2\0\0\0" + int32(0)) == GOAL + int32(0, 0)
    spin_until(cancelled.done)
    assert (cancelled.result().return_code, cancelled.result().goals_canceling) == (2, [])
    result = goal_handle.get_result_async()
    assert peer.answer(f"{topic}/get_result", SUCCEEDED + int32(1, 4)) == GOAL
    peer.send(f"rt/{topic}/status", int32(1) + GOAL + int32(5, 6) + SUCCEEDED)
    spin_until(lambda: result.done() and goal_handle.status == GoalStatus.STATUS_SUCCEEDED)
    assert list(result.result().result.sequence) == [4]
    client.destroy()
