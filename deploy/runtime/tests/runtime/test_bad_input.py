"""Malformed samples on topics and services are dropped, counted, and logged once for each writer."""

from __future__ import annotations

import random
import struct
import time
import tracemalloc
from pathlib import Path
from typing import Any

import pytest
from deploy.runtime.tests.nodes import Call, MakeNode, SpinUntil

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import SetParameters
from rclpy._dds import Participant, Writer
from rclpy._dds.library import blocking
from rclpy._discovery_info import NodeEntities, encode
from rclpy.exceptions import RCLError
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, Float64MultiArray, String
from std_srvs.srv import SetBool

HEADER = b"\0\1\0\0"
QUEUE = QoSProfile(depth=1000)
LATCHED = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def writer_for(participant: Participant, topic: str, type_name: str, spin_until: SpinUntil) -> Writer:
    """A writer that is matched with its reader, and looks like that of a client."""
    writer = participant.create_writer(topic, type_name, LATCHED, "clientid=1;")
    spin_until(writer.matched)
    return writer


@pytest.mark.parametrize(
    "data",
    [
        HEADER + b"\1",  # truncated
        b"\0\7\0\0" + bytes(8),  # another representation: XCDR2
    ],
)
def test_bad_samples_are_dropped_counted_and_logged_once(
    data: bytes,
    node: Node,
    participant: Participant,
    spin_until: SpinUntil,
    capfd: pytest.CaptureFixture[str],
) -> None:
    received: list[float] = []
    subscription = node.create_subscription(
        Float64, "x", lambda message: received.append(message.data), QUEUE
    )
    writer = writer_for(participant, "rt/x", "std_msgs::msg::dds_::Float64_", spin_until)
    for _ in range(50):
        writer.write(data)
    writer.write(HEADER + struct.pack("<d", 2.0))
    spin_until(lambda: received)
    assert received == [2.0]
    assert subscription._rclpy_bad_input.count == 50
    assert capfd.readouterr().err.count("octets on /x") == 1


def test_polling_a_bad_sample_raises_an_error(
    node: Node, executor: SingleThreadedExecutor, participant: Participant, spin_until: SpinUntil
) -> None:
    executor.remove_node(node)  # the executor would take the samples
    subscription = node.create_subscription(Float64, "x", lambda message: None, QUEUE)
    writer = writer_for(participant, "rt/x", "std_msgs::msg::dds_::Float64_", spin_until)
    writer.write(HEADER + b"\1")
    writer.write(HEADER + struct.pack("<d", 2.0))
    spin_until(lambda: blocking.dds_triggered(subscription.handle.condition))
    with pytest.raises(RCLError, match=r"failed to take message: .*std_msgs/msg/Float64"):
        subscription.handle.take_message(Float64, False)
    taken: list[Any] = []
    spin_until(lambda: taken.append(subscription.handle.take_message(Float64, False)) or taken[-1])
    assert taken[-1][0] == Float64(data=2.0)


def test_each_writer_of_bad_samples_is_logged_once(
    node: Node, participant: Participant, spin_until: SpinUntil, capfd: pytest.CaptureFixture[str]
) -> None:
    subscription = node.create_subscription(String, "x", lambda message: None, QUEUE)
    writers = [writer_for(participant, "rt/x", "std_msgs::msg::dds_::String_", spin_until) for _ in range(3)]
    for writer in writers * 2:
        writer.write(HEADER + b"\xff\xff\xff\x7fabcd")  # claims a string of 2 GB
    spin_until(lambda: subscription._rclpy_bad_input.count == 6)
    assert capfd.readouterr().err.count("octets on /x") == 3


def test_an_invalid_clock_message_is_bad_input(
    make_node: MakeNode,
    executor: SingleThreadedExecutor,
    participant: Participant,
    spin_until: SpinUntil,
    capfd: pytest.CaptureFixture[str],
) -> None:
    node = make_node(parameter_overrides=[Parameter("use_sim_time", value=True)])
    executor.add_node(node)
    (subscription,) = node.subscriptions
    type_name = "rosgraph_msgs::msg::dds_::Clock_"
    writers = [writer_for(participant, "rt/clock", type_name, spin_until) for _ in range(2)]
    spin_until(lambda: subscription.get_publisher_count() == 2)
    # one by one, because the subscription keeps only the last sample
    for number, writer in enumerate(writers * 2, 1):
        writer.write(HEADER + struct.pack("<iI", -1, 0))
        spin_until(lambda number=number: subscription._rclpy_bad_input.count == number)
    assert node.get_clock().now().nanoseconds == 0
    writers[0].write(HEADER + struct.pack("<iI", 5, 7))
    spin_until(lambda: node.get_clock().now().nanoseconds == 5_000_000_007)
    assert capfd.readouterr().err.count("octets on /clock") == 2


@pytest.mark.parametrize("message_type", [DiagnosticArray, Float64MultiArray, String])
@pytest.mark.parametrize("count", [0x7FFFFFFF, 0xFFFFFFFF, 100_000_000])
def test_huge_counts_cost_no_memory_and_no_time(message_type: Any, count: int) -> None:
    sample = HEADER + struct.pack("<I", count) * 20
    begin = time.thread_time()
    with pytest.raises(ValueError, match="not a valid"):
        message_type._deserialize(sample)
    assert time.thread_time() - begin < 0.1  # s; a hundred million of anything take longer
    tracemalloc.start()
    try:
        with pytest.raises(ValueError, match="not a valid"):
            message_type._deserialize(sample)
        assert tracemalloc.get_traced_memory()[1] < 20_000  # bytes, at the peak
    finally:
        tracemalloc.stop()


def allocated() -> int:
    """The private memory of this process [kB], including what it has not touched yet."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if "VmData" in line)
    return int(line.split()[1])


def test_bad_samples_leave_no_memory_behind(
    node: Node, participant: Participant, spin_until: SpinUntil
) -> None:
    subscription = node.create_subscription(Float64, "x", lambda message: None, QUEUE)
    writer = writer_for(participant, "rt/x", "std_msgs::msg::dds_::Float64_", spin_until)

    def feed(number: int) -> None:
        wanted = subscription._rclpy_bad_input.count + number
        for _ in range(number):
            writer.write(HEADER + b"\1")
        spin_until(lambda: subscription._rclpy_bad_input.count == wanted)

    feed(200)
    before = allocated()
    feed(200)
    assert allocated() < before + 20_000


def test_random_samples_are_dropped_or_delivered(
    node: Node, participant: Participant, spin_until: SpinUntil
) -> None:
    good: list[Any] = []
    subscription = node.create_subscription(DiagnosticArray, "x", good.append, QUEUE)
    writer = writer_for(participant, "rt/x", "diagnostic_msgs::msg::dds_::DiagnosticArray_", spin_until)
    source = random.Random(0)
    for _ in range(10):
        for _ in range(50):
            writer.write(HEADER + source.randbytes(source.randrange(1, 200)))
        done = subscription._rclpy_bad_input.count + len(good) + 50
        spin_until(lambda done=done: subscription._rclpy_bad_input.count + len(good) == done)


def test_a_service_survives_bad_requests(
    node: Node, participant: Participant, spin_until: SpinUntil, call: Call
) -> None:
    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success = request.data
        return response

    service = node.create_service(SetBool, "switch", answer)
    writer = writer_for(participant, "rq/switchRequest", "std_srvs::srv::dds_::SetBool_Request_", spin_until)
    for data in (b"\1", bytes(8), bytes(15), bytes(16), b"\xff" * 40):
        writer.write(HEADER + data)
    assert call(SetBool, "switch", data=True) == SetBool.Response(success=True)
    assert service._rclpy_bad_input.count >= 4


def test_the_parameter_services_survive_bad_requests(
    participant: Participant, spin_until: SpinUntil, call: Call
) -> None:
    writer = writer_for(
        participant,
        "rq/node/set_parametersRequest",
        "rcl_interfaces::srv::dds_::SetParameters_Request_",
        spin_until,
    )
    source = random.Random(1)
    for _ in range(200):
        writer.write(HEADER + bytes(16) + source.randbytes(source.randrange(1, 60)))
    assert call(SetParameters, "node/set_parameters") == SetParameters.Response()


def test_a_client_survives_bad_replies(node: Node, participant: Participant, spin_until: SpinUntil) -> None:
    client = node.create_client(SetBool, "switch")
    requests = participant.create_reader(
        "rq/switchRequest", "std_srvs::srv::dds_::SetBool_Request_", QUEUE, "serviceid=1;"
    )
    writer = participant.create_writer(
        "rr/switchReply", "std_srvs::srv::dds_::SetBool_Response_", QUEUE, "serviceid=1;"
    )
    spin_until(lambda: client.service_is_ready() and requests.matched() and writer.matched())
    future = client.call_async(SetBool.Request(data=True))
    samples: list[bytes] = []

    def has_request() -> bool:
        sample = requests.take()
        if sample is not None:
            samples.append(sample.data)
        return bool(samples)

    spin_until(has_request)
    identity = samples[0][4:20]
    for data in (b"\1", bytes(12), identity + b"\1", identity + b"\1\0\0\0\xff\xff\xff\xff"):
        writer.write(HEADER + data)
    spin_until(lambda: client._rclpy_bad_input.count == 4)
    assert not future.done()
    writer.write(HEADER + identity + b"\1\0\0\0\1\0\0\0\0")
    spin_until(future.done)
    assert future.result() == SetBool.Response(success=True)


def test_bad_discovery_info_is_dropped_counted_and_logged_once(
    node: Node, participant: Participant, spin_until: SpinUntil, capfd: pytest.CaptureFixture[str]
) -> None:
    writers = [
        writer_for(
            participant,
            "ros_discovery_info",
            "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_",
            spin_until,
        )
        for _ in range(2)
    ]
    source = random.Random(2)
    for _ in range(100):
        for writer in writers:
            # Random GUIDs, because only the last sample of each participant is read.
            writer.write(HEADER + source.randbytes(16) + b"\xff" * source.randrange(1, 200))

    def all_are_counted() -> bool:
        node.get_node_names()  # a query reads the pending samples
        return node._rclpy_graph._peers._bad_input.count == 200

    spin_until(all_are_counted)
    assert node.get_node_names() == ["node"]
    assert capfd.readouterr().err.count("octets on ros_discovery_info") == 2


def test_good_discovery_info_is_read_among_bad_samples(
    node: Node, participant: Participant, spin_until: SpinUntil
) -> None:
    writer = writer_for(
        participant, "ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_", spin_until
    )
    source = random.Random(2)
    for _ in range(100):
        writer.write(HEADER + source.randbytes(source.randrange(1, 200)))
    writer.write(encode(participant.gid, [NodeEntities("/far", "stranger")]))
    received: list[Float64] = []
    node.create_subscription(Float64, "x", received.append, 1)
    node.create_publisher(Float64, "x", 1).publish(Float64())
    spin_until(lambda: received)
    spin_until(lambda: set(node.get_fully_qualified_node_names()) == {"/node", "/far/stranger"})
