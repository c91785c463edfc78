"""What ``~/get_type_description`` tells of a type whose definition a user changes or removes meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rosidl_runtime_embedded import message_class
from type_description_interfaces.srv import GetTypeDescription


def test_a_type_in_use_is_described_as_it_was_when_it_was_loaded(
    make_node: Callable[..., Node],
    executor: SingleThreadedExecutor,
    spin_until: Callable[..., None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    definition = tmp_path / "share" / "changing_msgs" / "msg" / "Joint.msg"
    definition.parent.mkdir(parents=True)
    definition.write_text("float64 angle\n")
    joint = message_class("changing_msgs/msg/Joint")
    node = make_node("node")
    executor.add_node(node)
    node.create_publisher(joint, "joint", 1)
    definition.unlink()
    client = node.create_client(GetTypeDescription, "node/get_type_description")
    spin_until(client.service_is_ready)
    request = GetTypeDescription.Request(type_name="changing_msgs/msg/Joint", type_hash=joint._TYPE_HASH)
    future = client.call_async(request)
    spin_until(future.done)
    assert future.result().type_sources[0].raw_file_contents == "float64 angle\n"
