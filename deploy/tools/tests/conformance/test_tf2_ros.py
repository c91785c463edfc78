from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

pytest.importorskip("tf2_msgs.msg", reason="platform: no tf2_msgs here, as with ROS 2's wheels")

from deploy.tools.tests.transforms import transform
from rclpy.action import ActionServer
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.time import Time
from tf2_msgs.action import LookupTransform
from tf2_msgs.msg import TF2Error, TFMessage

from tf2_ros import (
    Buffer,
    BufferClient,
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    StaticTransformBroadcaster,
    TimeoutException,
    TransformBroadcaster,
    TransformException,
    TransformListener,
)


def x_of(buffer: Buffer, target: str, source: str) -> float:
    return float(buffer.lookup_transform(target, source, Time()).transform.translation.x)


@pytest.fixture
def other(make_node: MakeNode, executor: SingleThreadedExecutor) -> Node:
    other = make_node("other")
    executor.add_node(other)
    return other


@pytest.fixture
def spin_in_background(context: Context) -> Iterator[Callable[[Node], None]]:
    executor = MultiThreadedExecutor(3, context=context)
    thread = threading.Thread(target=executor.spin)

    def add(node: Node) -> None:
        executor.add_node(node)
        if not thread.is_alive():
            thread.start()

    yield add
    executor.shutdown()
    if thread.ident is not None:
        thread.join()


def test_a_listener_puts_broadcast_transforms_into_its_buffer(
    node: Node, other: Node, spin_until: SpinUntil
) -> None:
    buffer = Buffer()
    listener = TransformListener(buffer, node)
    broadcaster = TransformBroadcaster(other)
    spin_until(lambda: broadcaster.pub_tf.get_subscription_count() == 1)
    broadcaster.sendTransform(transform("map", "base", 1.0))
    broadcaster.sendTransform([transform("base", "arm", 2.0), transform("arm", "tool", 3.0)])
    broadcaster.sendTransform(iter([transform("tool", "tip", 4.0)]))
    spin_until(lambda: buffer.can_transform("map", "tip", Time()))
    assert x_of(buffer, "map", "tip") == 10.0
    assert "broadcaster: 'default_authority'" in buffer.all_frames_as_yaml()
    listener.unregister()
    spin_until(lambda: broadcaster.pub_tf.get_subscription_count() == 0)


def test_a_late_listener_gets_all_static_transforms(node: Node, other: Node, spin_until: SpinUntil) -> None:
    broadcaster = StaticTransformBroadcaster(other)
    broadcaster.sendTransform(transform("base", "camera", 1.0))
    broadcaster.sendTransform([transform("base", "lidar", 2.0), transform("lidar", "lens", 3.0)])
    buffer = Buffer()
    listener = TransformListener(buffer, node)
    spin_until(lambda: buffer.can_transform("camera", "lens", Time(seconds=100)))
    assert x_of(buffer, "camera", "lens") == 4.0
    listener.unregister()


def test_the_qos_is_that_of_tf(node: Node, other: Node, spin_until: SpinUntil) -> None:
    listener = TransformListener(Buffer(), node)
    TransformBroadcaster(other)
    StaticTransformBroadcaster(other)
    volatile, latched = DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL
    entities: list[tuple[Any, DurabilityPolicy]] = [
        (node.get_subscriptions_info_by_topic, volatile),
        (node.get_publishers_info_by_topic, volatile),
        (node.get_subscriptions_info_by_topic, latched),
        (node.get_publishers_info_by_topic, latched),
    ]
    for find, durability in entities:
        topic = "/tf" if durability == volatile else "/tf_static"
        spin_until(lambda find=find, topic=topic: find(topic))
        (info,) = find(topic)
        assert info.topic_type == "tf2_msgs/msg/TFMessage"
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert info.qos_profile.durability == durability
    listener.unregister()


def test_the_qos_can_be_chosen(make_node: MakeNode) -> None:
    node = make_node("chooser")
    best_effort = QoSProfile(depth=3, reliability=ReliabilityPolicy.BEST_EFFORT)
    listener = TransformListener(Buffer(), node, qos=best_effort, static_qos=7)
    assert listener.tf_sub.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert listener.tf_static_sub.qos_profile.depth == 7
    assert TransformBroadcaster(node, qos=5).pub_tf.qos_profile.depth == 5
    static = StaticTransformBroadcaster(node, qos=QoSProfile(depth=2)).pub_tf.qos_profile
    assert (static.depth, static.durability) == (2, DurabilityPolicy.VOLATILE)
    defaults = TransformListener(Buffer(), node)
    for profile in (defaults.tf_sub.qos_profile, defaults.tf_static_sub.qos_profile):
        assert (profile.history, profile.depth) == (HistoryPolicy.KEEP_LAST, 100)
    assert TransformBroadcaster(node).pub_tf.qos_profile.depth == 100
    assert StaticTransformBroadcaster(node).pub_tf.qos_profile.depth == 1


def test_a_static_message_of_another_publisher_is_heard(
    node: Node, other: Node, spin_until: SpinUntil
) -> None:
    buffer = Buffer()
    listener = TransformListener(buffer, node)
    qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = other.create_publisher(TFMessage, "/tf_static", qos)
    publisher.publish(TFMessage(transforms=[transform("base", "camera", 5.0)]))
    spin_until(lambda: buffer.can_transform("base", "camera", Time()))
    listener.unregister()


def test_a_callback_waits_for_a_transform_that_arrives_meanwhile(
    make_node: MakeNode, spin_in_background: Callable[[Node], None]
) -> None:
    node = make_node("waiter")
    buffer = Buffer()
    listener = TransformListener(buffer, node)
    broadcaster = TransformBroadcaster(node)
    found: list[float] = []
    done = threading.Event()

    def look_up() -> None:
        timer.cancel()
        timeout = Duration(seconds=10)
        found.append(buffer.lookup_transform("map", "base", Time(), timeout).transform.translation.x)
        done.set()

    timer = node.create_timer(0.01, look_up)
    sending = node.create_timer(
        0.05,
        lambda: broadcaster.sendTransform(transform("map", "base", 6.0)),
        callback_group=ReentrantCallbackGroup(),
    )
    spin_in_background(node)
    assert done.wait(20)
    sending.cancel()
    assert found == [6.0]
    listener.unregister()


# The buffer client

ERRORS = {
    TF2Error.LOOKUP_ERROR: LookupException,
    TF2Error.CONNECTIVITY_ERROR: ConnectivityException,
    TF2Error.EXTRAPOLATION_ERROR: ExtrapolationException,
    TF2Error.INVALID_ARGUMENT_ERROR: InvalidArgumentException,
    TF2Error.TIMEOUT_ERROR: TimeoutException,
    TF2Error.TRANSFORM_ERROR: TransformException,
}


class Server:
    """A buffer server that remembers its goals, and answers with a transform or an error."""

    def __init__(self, node: Node) -> None:
        self.goals: list[Any] = []
        self.answer = LookupTransform.Result(transform=transform("map", "base", 4.0))
        self.server = ActionServer(node, LookupTransform, "tf2_buffer_server", self.execute)

    def execute(self, goal_handle: Any) -> Any:
        self.goals.append(goal_handle.request)
        goal_handle.succeed()
        return self.answer


@pytest.fixture
def client(make_node: MakeNode, spin_in_background: Callable[[Node], None]) -> Iterator[BufferClient]:
    node = make_node("client")
    client = BufferClient(node, "tf2_buffer_server", timeout_padding=Duration(seconds=10))
    spin_in_background(node)
    yield client
    client.destroy()


@pytest.fixture
def server(
    make_node: MakeNode, spin_in_background: Callable[[Node], None], client: BufferClient
) -> Iterator[Server]:
    node = make_node("server")
    server = Server(node)
    spin_in_background(node)
    assert client.action_client.wait_for_server(timeout_sec=10)
    yield server
    server.server.destroy()


def test_a_buffer_client_asks_a_server(client: BufferClient, server: Server) -> None:
    found = client.lookup_transform("map", "base", Time(seconds=7), Duration(seconds=0.5))
    assert found == server.answer.transform
    (goal,) = server.goals
    assert (goal.target_frame, goal.source_frame, goal.source_time.sec) == ("map", "base", 7)
    assert (goal.timeout.nanosec, goal.advanced) == (500_000_000, False)
    assert client.can_transform("map", "base", Time())


def test_a_buffer_client_asks_for_a_transform_between_two_times(client: BufferClient, server: Server) -> None:
    arguments = "map", Time(seconds=5), "base", Time(seconds=7), "odom"
    assert client.lookup_transform_full(*arguments) == server.answer.transform
    (goal,) = server.goals
    assert (goal.target_time.sec, goal.source_time.sec, goal.fixed_frame) == (5, 7, "odom")
    assert goal.advanced
    assert client.can_transform_full(*arguments)


def test_an_error_of_the_server_is_raised(client: BufferClient, server: Server) -> None:
    for number, error in ERRORS.items():
        server.answer = LookupTransform.Result(error=TF2Error(error=number, error_string=f"no {number}"))
        with pytest.raises(error, match=f"no {number}") as caught:
            client.lookup_transform("map", "base", Time())
        assert type(caught.value) is error
        assert not client.can_transform("map", "base", Time())
        assert not client.can_transform_full("map", Time(), "base", Time(), "odom")


def test_without_a_server_there_is_an_error(client: BufferClient) -> None:
    with pytest.raises(TimeoutException, match="The BufferServer is not ready"):
        client.lookup_transform("map", "base", Time())


def test_a_time_must_be_a_time(client: BufferClient) -> None:
    with pytest.raises(TypeError, match=r"Must pass a rclpy\.time\.Time object"):
        client.lookup_transform("map", "base", 3.0)  # type: ignore[arg-type]
