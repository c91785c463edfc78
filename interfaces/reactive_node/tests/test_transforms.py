from __future__ import annotations

from typing import Any

import pytest

pytest.importorskip("tf2_msgs.msg", reason="platform: no tf2_msgs here, as with ROS 2's wheels")

from geometry_msgs.msg import TransformStamped
from rclpy.clock import JumpHandle
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from tf2_ros import (
    InvalidArgumentException,
    StaticTransformBroadcaster,
    TransformBroadcaster,
)

from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinFor, SpinUntil


def transform(parent: str, child: str, x: float, second: int = 0) -> TransformStamped:
    stamped = TransformStamped(child_frame_id=child)
    stamped.header.frame_id = parent
    stamped.header.stamp.sec = second
    stamped.transform.translation.x = x
    return stamped


class Watch:
    """The x coordinates [m] and times [s] of an observable's transforms."""

    def __init__(self, node: ReactiveNode, target: str, source: str) -> None:
        self.items: list[tuple[float, int]] = []
        self.errors: list[Exception] = []
        self.completed = False
        self.subscription = node.create_transform_observable(target, source).subscribe(
            self._next, self.errors.append, self._complete, scheduler=node.scheduler
        )

    def _next(self, item: Any) -> None:
        self.items.append((item.transform.translation.x, item.header.stamp.sec))

    def _complete(self) -> None:
        self.completed = True


@pytest.fixture
def dynamic(peer: Node) -> TransformBroadcaster:
    return TransformBroadcaster(peer)


@pytest.fixture
def static(peer: Node) -> StaticTransformBroadcaster:
    return StaticTransformBroadcaster(peer)


def heard(peer: Node) -> bool:
    return all(peer.count_subscribers(topic) for topic in ("/tf", "/tf_static"))


def test_transform_is_emitted_when_known_and_when_it_changes(
    node: ReactiveNode,
    peer: Node,
    dynamic: TransformBroadcaster,
    static: StaticTransformBroadcaster,
    spin_until: SpinUntil,
    spin_for: SpinFor,
) -> None:
    watch = Watch(node, "map", "tool")
    spin_until(lambda: heard(peer))

    dynamic.sendTransform(transform("map", "base", 1.0, second=10))
    spin_for(0.05)
    assert watch.items == []
    static.sendTransform(transform("base", "tool", 0.5))
    spin_until(lambda: watch.items == [(1.5, 10)])
    dynamic.sendTransform(transform("map", "elsewhere", 7.0, second=11))
    dynamic.sendTransform(transform("map", "base", 2.0, second=12))
    spin_until(lambda: len(watch.items) > 1)

    assert watch.items == [(1.5, 10), (2.5, 12)]


def test_late_observer_gets_present_transform_at_once(
    node: ReactiveNode, peer: Node, static: StaticTransformBroadcaster, spin_until: SpinUntil
) -> None:
    first = Watch(node, "base", "tool")
    spin_until(lambda: heard(peer))
    static.sendTransform(transform("base", "tool", 0.5))
    spin_until(lambda: first.items)

    late = Watch(node, "tool", "base")

    assert late.items == [(-0.5, 0)]


def test_observers_share_readers_and_last_one_forgets_transforms(
    node: ReactiveNode, peer: Node, dynamic: TransformBroadcaster, spin_until: SpinUntil
) -> None:
    first, second = Watch(node, "map", "base"), Watch(node, "base", "map")
    spin_until(lambda: heard(peer))
    assert len([one for one in node.subscriptions if one.topic_name in ("/tf", "/tf_static")]) == 2
    dynamic.sendTransform(transform("map", "base", 1.0, second=10))
    spin_until(lambda: first.items and second.items)

    first.subscription.dispose()
    second.subscription.dispose()
    assert not [one for one in node.subscriptions if one.topic_name in ("/tf", "/tf_static")]
    again = Watch(node, "map", "base")

    assert again.items == []


def test_invalid_frame_is_error(node: ReactiveNode) -> None:
    watch = Watch(node, "", "base")

    assert isinstance(watch.errors[0], InvalidArgumentException)
    assert not [one for one in node.subscriptions if one.topic_name == "/tf"]


def test_jump_back_of_simulated_time_forgets_transforms(
    make_node: MakeNode, peer: Node, dynamic: TransformBroadcaster, spin_until: SpinUntil
) -> None:
    node = make_node("simulated", parameter_overrides=[Parameter("use_sim_time", value=True)])
    clock = peer.create_publisher(Clock, "/clock", 10)
    watch = Watch(node, "map", "base")
    spin_until(lambda: heard(peer) and clock.get_subscription_count() > 0)

    def set_time(seconds: int) -> None:
        message = Clock()
        message.clock.sec = seconds
        clock.publish(message)
        spin_until(lambda: node.get_clock().now().nanoseconds == seconds * 10**9)

    set_time(1000)
    dynamic.sendTransform(transform("map", "base", 1.0, second=1000))
    spin_until(lambda: watch.items == [(1.0, 1000)])
    set_time(10)
    dynamic.sendTransform(transform("map", "base", 2.0, second=10))
    spin_until(lambda: watch.items == [(1.0, 1000), (2.0, 10)])


def test_last_observer_stops_to_watch_for_jumps(node: ReactiveNode, monkeypatch: pytest.MonkeyPatch) -> None:
    unregistered: list[JumpHandle] = []
    unregister = JumpHandle.unregister

    def record(handle: JumpHandle) -> None:
        unregistered.append(handle)
        unregister(handle)

    monkeypatch.setattr(JumpHandle, "unregister", record)
    first, second = Watch(node, "map", "base"), Watch(node, "base", "map")

    first.subscription.dispose()
    assert unregistered == []
    second.subscription.dispose()
    assert len(unregistered) == 1


def test_transforms_complete_with_node(node: ReactiveNode) -> None:
    watch = Watch(node, "map", "base")

    node.destroy_node()

    assert watch.completed
