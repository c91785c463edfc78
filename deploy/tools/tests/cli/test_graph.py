"""The graph, with a node whose name is not UTF-8: rclpy of ROS 2 raises then."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import click
import pytest
import rclpy

from ros2cli import graph


class Stranger:
    """In place of a node that sees a stranger."""

    def get_node_names(self) -> list[str]:
        raise UnicodeDecodeError("utf-8", b"\xff bad", 0, 1, "invalid start byte")

    def get_publishers_info_by_topic(self, topic: str) -> list[Any]:
        return self.get_node_names()

    def get_topic_names_and_types(self, **_: Any) -> list[tuple[str, list[str]]]:
        return [("/engines", ["std_msgs/msg/String"])]


def test_discovery_goes_on_beside_a_name_that_is_not_utf_8() -> None:
    node: Any = Stranger()
    graph.discover(node, 10.0, lambda _: True)
    assert graph.publishers(node, "/engines") == []


def test_a_topic_of_two_types_has_no_message_class() -> None:
    node: Any = SimpleNamespace(
        get_name=lambda: "tool",
        get_namespace=lambda: "/",
        get_topic_names_and_types=lambda: [("/x", ["std_msgs/msg/Float64", "std_msgs/msg/String"])],
    )
    with pytest.raises(RuntimeError, match="more than one type"):
        graph.message_class(node, "x")


def test_name_that_is_not_utf_8_is_an_error_of_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rclpy, "init", lambda **_: None)
    monkeypatch.setattr(rclpy, "create_node", lambda *_, **__: Stranger())
    with pytest.raises(click.ClickException, match="is not UTF-8") as error, graph.node(0.0) as node:
        node.get_node_names()
    assert "\n" not in str(error.value)
