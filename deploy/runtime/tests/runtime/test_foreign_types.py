"""Message classes that ROS 2's own generator has made: each use is one clear error."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode

from rclpy.action import ActionClient, ActionServer
from rclpy.node import Node
from rclpy.serialization import deserialize_message, serialize_message

REASON = r"<class '.*Generated'> was generated for ROS 2's own rclpy.*AMENT_PREFIX_PATH"


class Metaclass_Generated(type):
    _TYPE_SUPPORT = None

    @classmethod
    def __import_type_support__(cls) -> None:
        raise AssertionError("the library of ROS 2 must not be loaded")


class Generated(metaclass=Metaclass_Generated):
    """Stands in for a class of a package that was built for ROS 2."""

    __slots__ = ("_data",)


USES: dict[str, Callable[[Node], Any]] = {
    "publisher": lambda node: node.create_publisher(Generated, "x", 1),
    "subscription": lambda node: node.create_subscription(Generated, "x", print, 1),
    "raw subscription": lambda node: node.create_subscription(Generated, "x", print, 1, raw=True),
    "service": lambda node: node.create_service(Generated, "x", print),
    "client": lambda node: node.create_client(Generated, "x"),
    "action server": lambda node: ActionServer(node, Generated, "x", print),
    "action client": lambda node: ActionClient(node, Generated, "x"),
    "serialization": lambda node: serialize_message(Generated()),
    "deserialization": lambda node: deserialize_message(b"", Generated),
}


@pytest.mark.parametrize("use", USES)
def test_a_class_of_the_other_runtime_is_named(make_node: MakeNode, use: str) -> None:
    with pytest.raises(AttributeError, match=REASON) as error:
        USES[use](make_node())
    assert "\n" not in str(error.value)
