"""The properties of a publisher or subscription in the graph."""

from __future__ import annotations

from enum import IntEnum
from typing import Any

from rclpy._checked import Checked
from rclpy.qos import HistoryPolicy, QoSPresetProfiles, QoSProfile
from rclpy.type_hash import TypeHash


class TopicEndpointTypeEnum(IntEnum):
    """Whether an endpoint is a publisher or a subscription."""

    INVALID = 0
    PUBLISHER = 1
    SUBSCRIPTION = 2


class TopicEndpointInfo:
    """A publisher or subscription: its node, type, identity and quality of service."""

    __slots__ = (
        "_node_name",
        "_node_namespace",
        "_topic_type",
        "_topic_type_hash",
        "_endpoint_type",
        "_endpoint_gid",
        "_qos_profile",
    )

    # Not hashable, because it is mutable, as in rclpy.
    __hash__ = None  # type: ignore[assignment]

    node_name = Checked(str, "The name of its node.")
    node_namespace = Checked(str, "The namespace of its node.")
    topic_type = Checked(str, "The type of the messages, for example `std_msgs/msg/String`.")
    topic_type_hash = Checked(
        TypeHash,
        "The hash of the type's definition. A dictionary of its properties can be assigned, too.",
        dict,
        lambda properties: TypeHash(**properties),
    )
    endpoint_type = Checked(TopicEndpointTypeEnum, "Whether it is a publisher or a subscription.", int)
    qos_profile = Checked(
        QoSProfile,
        "The quality of service. A dictionary of policies can be assigned, too.",
        dict,
        lambda policies: QoSProfile(**policies),
    )

    def __init__(self, **kwargs: Any) -> None:
        """Create it from properties by name. Missing ones are empty or unknown."""
        assert all(f"_{key}" in self.__slots__ for key in kwargs), (
            f"Invalid arguments passed to constructor: {list(kwargs)}"
        )
        self.node_name = kwargs.get("node_name", "")
        self.node_namespace = kwargs.get("node_namespace", "")
        self.topic_type = kwargs.get("topic_type", "")
        self.topic_type_hash = kwargs.get("topic_type_hash", TypeHash())
        self.endpoint_type = kwargs.get("endpoint_type", TopicEndpointTypeEnum.INVALID)
        self.endpoint_gid = kwargs.get("endpoint_gid", [])
        self.qos_profile = kwargs.get("qos_profile", QoSPresetProfiles.UNKNOWN.value)

    @property
    def endpoint_gid(self) -> list[int]:
        """The bytes of its GID, the identity in the middleware."""
        return self._endpoint_gid

    @endpoint_gid.setter
    def endpoint_gid(self, value: list[int]) -> None:
        assert all(isinstance(byte, int) for byte in value), f"endpoint_gid must be ints, not {value!r}"
        self._endpoint_gid = value

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, TopicEndpointInfo):
            return False
        return all(getattr(self, slot) == getattr(other, slot) for slot in self.__slots__)

    def __str__(self) -> str:
        qos = self.qos_profile
        depth = f" ({qos.depth})" if qos.history == HistoryPolicy.KEEP_LAST else ""
        return "\n".join(
            (
                f"Node name: {self.node_name}",
                f"Node namespace: {self.node_namespace}",
                f"Topic type: {self.topic_type}",
                f"Topic type hash: {self.topic_type_hash}",
                f"Endpoint type: {self.endpoint_type.name}",
                f"GID: {'.'.join(f'{byte:02x}' for byte in self.endpoint_gid)}",
                "QoS profile:",
                f"  Reliability: {qos.reliability.name}",
                f"  History (Depth): {qos.history.name}{depth}",
                f"  Durability: {qos.durability.name}",
                f"  Lifespan: {qos.lifespan}",
                f"  Deadline: {qos.deadline}",
                f"  Liveliness: {qos.liveliness.name}",
                f"  Liveliness lease duration: {qos.liveliness_lease_duration}",
            )
        )
