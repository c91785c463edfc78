"""``~/get_type_description`` for a type whose definition file has changed or is gone."""

from __future__ import annotations

from pathlib import Path

import pytest
from deploy.runtime.tests.nodes import MakeNode, SpinUntil

from rclpy.executors import SingleThreadedExecutor
from rosidl_runtime_embedded import message_class
from type_description_interfaces.srv import GetTypeDescription


def test_a_type_in_use_keeps_the_description_it_was_loaded_with(
    make_node: MakeNode,
    executor: SingleThreadedExecutor,
    spin_until: SpinUntil,
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
