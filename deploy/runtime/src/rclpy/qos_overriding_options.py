"""QoS policies of publishers and subscriptions as read-only parameters of their node.

The parameters are named `qos_overrides.<topic>.<publisher|subscription>[_<id>].<policy>`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeAlias

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.duration import Duration
from rclpy.exceptions import ParameterAlreadyDeclaredException
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSPolicyEnum,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
)

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.publisher import Publisher
    from rclpy.subscription import Subscription

QosCallbackResult: TypeAlias = SetParametersResult
QosCallbackType: TypeAlias = Callable[[QoSProfile], QosCallbackResult]

_ENUMS: dict[QoSPolicyKind, type[QoSPolicyEnum]] = {
    QoSPolicyKind.HISTORY: HistoryPolicy,
    QoSPolicyKind.RELIABILITY: ReliabilityPolicy,
    QoSPolicyKind.DURABILITY: DurabilityPolicy,
    QoSPolicyKind.LIVELINESS: LivelinessPolicy,
}


class InvalidQosOverridesError(Exception):
    """Raised when the callback of `QoSOverridingOptions` rejects the profile."""


class QoSOverridingOptions:
    """Selects the policies of a publisher or subscription that parameters may override."""

    def __init__(
        self,
        policy_kinds: Iterable[QoSPolicyKind],
        *,
        callback: QosCallbackType | None = None,
        entity_id: str | None = None,
    ) -> None:
        """Select policies; ``callback`` judges the profile, ``entity_id`` tells entities of a topic apart."""
        self._policy_kinds = policy_kinds
        self._callback = callback
        self._entity_id = entity_id

    @property
    def policy_kinds(self) -> Iterable[QoSPolicyKind]:
        return self._policy_kinds

    @property
    def callback(self) -> QosCallbackType | None:
        """Returns whether the profile is valid with all overrides."""
        return self._callback

    @property
    def entity_id(self) -> str | None:
        """Distinguishes the entity from others of its kind on the same topic."""
        return self._entity_id

    @classmethod
    def with_default_policies(
        cls, *, callback: QosCallbackType | None = None, entity_id: str | None = None
    ) -> QoSOverridingOptions:
        """Select history, depth and reliability."""
        return cls(
            policy_kinds=(QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY),
            callback=callback,
            entity_id=entity_id,
        )


def _declare_qos_parameters(
    entity_type: type[Publisher] | type[Subscription],
    node: Node,
    topic_name: str,
    qos: QoSProfile,
    options: QoSOverridingOptions,
) -> None:
    """Declare the parameters of an entity and set their values in `qos`.

    :param topic_name: the fully qualified name of the topic.
    :raises TypeError: if `entity_type` is neither a publisher nor a subscription.
    :raises ValueError: if a policy of `qos` is unknown.
    :raises RuntimeError: if an override is not a value of its policy.
    :raises InvalidQosOverridesError: if the callback rejects the profile.
    """
    entity = _entity_name(entity_type)
    prefix = f"qos_overrides.{topic_name}.{entity}"
    if options.entity_id is not None:
        prefix = f"{prefix}_{options.entity_id}"
    owner = f"for {entity} `{topic_name}` with id `{options.entity_id}`"
    for kind in options.policy_kinds:
        if entity == "subscription" and kind is QoSPolicyKind.LIFESPAN:
            continue
        policy = kind.name.lower()
        name = f"{prefix}.{policy}"
        descriptor = ParameterDescriptor(description=f"{policy} {owner}", read_only=True)
        try:
            value = node.declare_parameter(name, _get_qos_policy_parameter(qos, kind), descriptor).value
        except ParameterAlreadyDeclaredException:
            value = node.get_parameter(name).value
        setattr(qos, policy, _from_parameter(kind, value))
    if options.callback is not None:
        result = options.callback(qos)
        if not result.successful:
            raise InvalidQosOverridesError(f"Provided QoS overrides {owner}, are not valid: {result.reason}")


def _entity_name(entity_type: type[Publisher] | type[Subscription]) -> str:
    from rclpy.publisher import Publisher
    from rclpy.subscription import Subscription

    if issubclass(entity_type, Publisher):
        return "publisher"
    if issubclass(entity_type, Subscription):
        return "subscription"
    raise TypeError("Argument `entity_type` should be a subclass of Publisher or Subscription")


def _get_qos_policy_parameter(qos: QoSProfile, policy: QoSPolicyKind) -> str | int | bool:
    """Convert a policy to the value of its parameter: an enumeration to its name, a duration to [ns]."""
    value = getattr(qos, policy.name.lower())
    if isinstance(value, QoSPolicyEnum):
        if value.short_key == "unknown":
            raise ValueError("User provided QoS profile is invalid")
        return value.short_key
    if isinstance(value, Duration):
        return value.nanoseconds
    assert isinstance(value, (int, bool))
    return value


def _from_parameter(
    kind: QoSPolicyKind, value: str | int | bool
) -> QoSPolicyEnum | Duration | int | bool | str:
    """Convert the value of a parameter to the policy: the inverse of `_get_qos_policy_parameter`."""
    if kind in _ENUMS:
        try:
            return _ENUMS[kind][str(value).upper()]
        except KeyError:
            raise RuntimeError(
                f"Unexpected QoS override for policy `{kind.name.lower()}`: `{value}`"
            ) from None
    if kind in (QoSPolicyKind.LIFESPAN, QoSPolicyKind.DEADLINE, QoSPolicyKind.LIVELINESS_LEASE_DURATION):
        return Duration(nanoseconds=int(value))
    return value
