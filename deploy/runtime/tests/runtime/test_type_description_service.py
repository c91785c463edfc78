"""``~/get_type_description`` for a type whose definition file has changed or is gone."""

from __future__ import annotations

from pathlib import Path

import pytest
from deploy.runtime.tests.nodes import Call

from rclpy.node import Node
from rosidl_runtime_embedded import message_class
from type_description_interfaces.srv import GetTypeDescription


def test_a_type_in_use_keeps_the_description_it_was_loaded_with(
    node: Node, call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    definition = tmp_path / "share" / "changing_msgs" / "msg" / "Joint.msg"
    definition.parent.mkdir(parents=True)
    definition.write_text("float64 angle\n")
    joint = message_class("changing_msgs/msg/Joint")
    node.create_publisher(joint, "joint", 1)
    definition.unlink()
    service = "node/get_type_description"
    described = call(GetTypeDescription, service, type_name=joint._TYPE_NAME, type_hash=joint._TYPE_HASH)
    assert described.type_sources[0].raw_file_contents == "float64 angle\n"
