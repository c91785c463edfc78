"""Resolves "best available" QoS policies when an entity is created, from the endpoints that are known then.

Source: rmw_dds_common of Jazzy. Endpoints that come later do not change the choice.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rclpy_ground.interface import Endpoint

if TYPE_CHECKING:  # not at run time: the ground is chosen before rclpy is imported
    from rclpy.qos import QoSProfile


def has_open_policy(profile: QoSProfile) -> bool:
    """Whether a policy of the profile is "best available"."""
    return bool(_open_policies(profile))


def for_subscription(profile: QoSProfile, topic: str, writers: list[Endpoint]) -> None:
    """Request the strictest policies that all publishers offer: so all of them match."""
    from rclpy.duration import Infinite
    from rclpy.qos import DurabilityPolicy, LivelinessPolicy, ReliabilityPolicy

    offered = [each.profile for each in writers if each.topic == topic]
    reliable = all(each.reliability == ReliabilityPolicy.RELIABLE for each in offered)
    latched = all(each.durability == DurabilityPolicy.TRANSIENT_LOCAL for each in offered)
    manual = all(each.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC for each in offered)
    _close(
        profile,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if manual else LivelinessPolicy.AUTOMATIC,
        deadline=max((each.deadline for each in offered), default=Infinite),
        liveliness_lease_duration=max((each.liveliness_lease_duration for each in offered), default=Infinite),
    )


def for_publisher(profile: QoSProfile, topic: str, readers: list[Endpoint]) -> None:
    """Offer at least the strictest policy that a subscription requests: so all of them match."""
    from rclpy.duration import Infinite
    from rclpy.qos import DurabilityPolicy, LivelinessPolicy, ReliabilityPolicy

    requested = [each.profile for each in readers if each.topic == topic]
    manual = any(each.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC for each in requested)
    leases = (each.liveliness_lease_duration for each in requested)
    _close(
        profile,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if manual else LivelinessPolicy.AUTOMATIC,
        deadline=min((each.deadline for each in requested), default=Infinite),
        liveliness_lease_duration=min(leases, default=Infinite),
    )


def for_service(profile: QoSProfile) -> None:
    """Use the default policies of services, as all services and clients do."""
    from rclpy.qos import qos_profile_services_default as default

    _close(profile, **{policy: getattr(default, policy) for policy in _open_policies(profile)})


def _open_policies(profile: QoSProfile) -> list[str]:
    from rclpy.qos import qos_profile_best_available as best

    policies = ("reliability", "durability", "liveliness", "deadline", "liveliness_lease_duration")
    return [policy for policy in policies if getattr(profile, policy) == getattr(best, policy)]


def _close(profile: QoSProfile, **best: Any) -> None:
    for policy in _open_policies(profile):
        setattr(profile, policy, best[policy])
