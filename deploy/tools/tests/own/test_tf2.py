"""What this tf2 does better than that of ROS 2."""

from __future__ import annotations

import functools
import threading
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

pytest.importorskip("tf2_msgs.msg", reason="platform: no tf2_msgs here, as with ROS 2's wheels")

from deploy.tools.tests.transforms import transform
from geometry_msgs.msg import Vector3, Vector3Stamped
from rclpy.duration import Duration, Infinite
from rclpy.node import Node
from rclpy.time import Time

import tf2_geometry_msgs
from tf2_ros import Buffer, BufferClient, StaticTransformBroadcaster, TransformBroadcaster, TransformListener

pytestmark = pytest.mark.own


def test_a_chain_has_all_frames_from_the_source_to_the_target() -> None:
    buffer = Buffer()
    for child in ("left", "right"):
        buffer.set_transform_static(transform("map", child), "test")
    chain = functools.partial(buffer._chain, target_time=Time(), source_time=Time())
    assert chain(target_frame="left", source_frame="right", fixed_frame="map") == ["right", "map", "left"]
    assert chain(target_frame="map", source_frame="right", fixed_frame="map") == ["right", "map"]
    assert chain(target_frame="left", source_frame="map", fixed_frame="left") == ["map", "left"]


def test_a_new_static_transform_replaces_the_old_one(make_node: MakeNode) -> None:
    broadcaster = StaticTransformBroadcaster(make_node())
    message = transform("map", "camera", 1.0)
    broadcaster.sendTransform(message)
    message.child_frame_id = "lidar"  # the same message for another transform
    broadcaster.sendTransform(message)
    assert broadcaster.net_message.transforms == [
        transform("map", "camera", 1.0),
        transform("map", "lidar", 1.0),
    ]
    broadcaster.sendTransform(transform("map", "camera", 2.0))
    assert broadcaster.net_message.transforms == [
        transform("map", "camera", 2.0),
        transform("map", "lidar", 1.0),
    ]


def test_transforming_a_vector_leaves_the_transform_as_it_is() -> None:
    by = transform("map", "robot", 3.0)
    tf2_geometry_msgs.do_transform_vector3(Vector3Stamped(vector=Vector3(x=1.0)), by)
    assert by == transform("map", "robot", 3.0)


def test_a_cancelled_future_stays_cancelled() -> None:
    buffer = Buffer()
    cancelled = buffer.wait_for_transform_async("map", "robot", Time())
    cancelled.cancel()
    future = buffer.wait_for_transform_async("map", "robot", Time())
    buffer.set_transform(transform("map", "robot"), "test")
    assert cancelled.cancelled()
    assert future.done()


def test_a_wait_without_end_ends_with_the_transform() -> None:
    asked = threading.Event()

    class Asked(Buffer):
        def can_transform_core(self, *args: Any) -> tuple[bool, str]:
            asked.set()
            return super().can_transform_core(*args)

    buffer = Asked()
    waiting = threading.Thread(target=buffer.can_transform, args=("map", "robot", Time(), Infinite))
    waiting.daemon = True
    waiting.start()
    assert asked.wait(10)
    buffer.set_transform(transform("map", "robot"), "test")
    waiting.join(10)
    assert not waiting.is_alive()


def test_the_padding_of_a_buffer_client_may_be_seconds(make_node: MakeNode) -> None:
    client = BufferClient(make_node(), "server", timeout_padding=0.5)
    assert not client.can_transform("map", "robot", Time(), Duration(seconds=0.1))
    client.destroy()


def test_a_listener_may_spin_its_node_itself(make_node: MakeNode, node: Node, spin_until: SpinUntil) -> None:
    buffer = Buffer()
    listener = TransformListener(buffer, make_node("listener"), spin_thread=True)
    broadcaster = TransformBroadcaster(node)
    spin_until(lambda: broadcaster.pub_tf.get_subscription_count() == 1)
    broadcaster.sendTransform(transform("map", "robot", 1.0))
    assert buffer.can_transform("map", "robot", Time(), Duration(seconds=10))
    listener.executor.shutdown()
    listener.dedicated_listener_thread.join(10)
    assert not listener.dedicated_listener_thread.is_alive()
