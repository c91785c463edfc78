"""Resolves "best available" QoS policies when an entity is created, from the endpoints that are known then.

Source: rmw_dds_common of Jazzy. Endpoints that come later do not change the choice.
"""

from __future__ import annotations

from typing import Any

from rclpy.duration import Infinite
from rclpy.qos import (
    DurabilityPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_best_available,
    qos_profile_services_default,
)

_POLICIES = ("reliability", "durability", "liveliness", "deadline", "liveliness_lease_duration")


def has_open_policy(profile: QoSProfile) -> bool:
    """Whether a policy of the profile is "best available"."""
    return any(_is_open(profile, policy) for policy in _POLICIES)


def for_subscription(profile: QoSProfile, publishers: list[QoSProfile]) -> QoSProfile:
    """Request the strictest policies that all publishers offer: so all of them match."""
    reliable = all(offered.reliability == ReliabilityPolicy.RELIABLE for offered in publishers)
    latched = all(offered.durability == DurabilityPolicy.TRANSIENT_LOCAL for offered in publishers)
    manual = all(offered.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC for offered in publishers)
    leases = (offered.liveliness_lease_duration for offered in publishers)
    return _closed(
        profile,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if manual else LivelinessPolicy.AUTOMATIC,
        deadline=max((offered.deadline for offered in publishers), default=Infinite),
        liveliness_lease_duration=max(leases, default=Infinite),
    )


def for_publisher(profile: QoSProfile, subscriptions: list[QoSProfile]) -> QoSProfile:
    """Offer at least the strictest policy that a subscription requests: so all of them match."""
    manual = any(requested.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC for requested in subscriptions)
    leases = (requested.liveliness_lease_duration for requested in subscriptions)
    return _closed(
        profile,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC if manual else LivelinessPolicy.AUTOMATIC,
        deadline=min((requested.deadline for requested in subscriptions), default=Infinite),
        liveliness_lease_duration=min(leases, default=Infinite),
    )


def for_service(profile: QoSProfile) -> QoSProfile:
    """Use the default policies of services, as all services and clients do."""
    default = qos_profile_services_default
    return _closed(profile, **{policy: getattr(default, policy) for policy in _POLICIES})


def _is_open(profile: QoSProfile, policy: str) -> bool:
    return bool(getattr(profile, policy) == getattr(qos_profile_best_available, policy))


def _closed(profile: QoSProfile, **best: Any) -> QoSProfile:
    """A copy of the profile whose "best available" policies have the given values."""
    if not has_open_policy(profile):
        return profile
    closed = profile._rclpy_copy()
    for policy, value in best.items():
        if _is_open(profile, policy):
            setattr(closed, policy, value)
    return closed
