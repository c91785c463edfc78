"""Nodes with a publisher of ``/rosout``."""

from __future__ import annotations

import weakref
from typing import Any

from rclpy_ground import nodes, process
from rclpy_ground.contexts import Context
from rclpy_ground.genuine import predefined
from rclpy_ground.topics import Publisher


class Node(nodes.Node):
    def __init__(
        self,
        name: str,
        namespace: str,
        context: Context,
        cli_args: list[str] | None,
        use_global_arguments: bool,
        enable_rosout: bool,
        rosout_qos: Any = None,
    ) -> None:
        super().__init__(name, namespace, context, cli_args, use_global_arguments)
        self._process = process.current  # another one may run when the node is freed
        self._rosout: Publisher | None = None
        if enable_rosout:
            from rcl_interfaces.msg import Log

            self._rosout = Publisher(self, Log, "/rosout", rosout_qos or _default_qos())
            self._process.rosout[self.logger] = weakref.ref(self._rosout)

    def destroy(self) -> None:
        self._process.rosout.pop(self.logger, None)
        if self._rosout is not None:
            self._rosout.destroy_when_not_in_use()
        super().destroy()


def _default_qos() -> Any:
    """Return rcl_qos_profile_rosout_default."""
    from rclpy.duration import Duration
    from rclpy.qos import DurabilityPolicy, QoSProfile

    profile = QoSProfile(**predefined("qos_profile_default").to_dict())
    profile.depth, profile.durability = 1000, DurabilityPolicy.TRANSIENT_LOCAL
    profile.lifespan = Duration(seconds=10)
    return profile.get_c_qos_profile()
