"""Quality of service: the policies that publishers offer and subscriptions request.

Source of the presets: `rmw/qos_profiles.h`; of the policies' numbers: `rmw/types.h`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable
from enum import Enum, IntEnum
from typing import Any, NoReturn, TypeVar

from rclpy._checked import Checked
from rclpy.duration import Duration


class QoSPolicyKind(IntEnum):
    """The policies of a profile, in QoS events and QoS overrides."""

    INVALID = 1 << 0
    DURABILITY = 1 << 1
    DEADLINE = 1 << 2
    LIVELINESS = 1 << 3
    RELIABILITY = 1 << 4
    HISTORY = 1 << 5
    LIFESPAN = 1 << 6
    DEPTH = 1 << 7
    LIVELINESS_LEASE_DURATION = 1 << 8
    AVOID_ROS_NAMESPACE_CONVENTIONS = 1 << 9


def qos_policy_name_from_kind(policy_kind: QoSPolicyKind | int) -> str:
    """Return the name of a policy, for example `DURABILITY`."""
    return QoSPolicyKind(policy_kind).name


class InvalidQoSProfileException(Exception):
    """Raised when a profile is created from contradictory settings."""

    def __init__(self, *args: Any) -> None:
        super().__init__("Invalid QoSProfile", *args)


class QoSPolicyEnum(IntEnum):
    """Base of the policies' enumerations, with access to members by lower-case names."""

    @classmethod
    def short_keys(cls) -> list[str]:
        """Return the lower-case names of all members."""
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> int:
        """Return the member's number by name, in upper or lower case. Raises KeyError if there is none."""
        return cls[name.upper()].value

    @property
    def short_key(self) -> str:
        return self.name.lower()


_Policy = TypeVar("_Policy", bound=type[QoSPolicyEnum])


class _DeprecatedAlias:
    """The name of a member before ROS 2 Foxy: it works, with a warning."""

    def __init__(self, deprecated: str, replacement: str) -> None:
        self._deprecated = deprecated
        self._replacement = replacement

    def __get__(self, instance: object, policy: type[QoSPolicyEnum]) -> QoSPolicyEnum:
        name = policy.__name__
        warnings.warn(
            f"{name}.{self._deprecated} is deprecated. Use {name}.{self._replacement} instead.", stacklevel=2
        )
        return policy[self._replacement]


def _deprecated_aliases(prefix: str, names: Iterable[str]) -> Callable[[_Policy], _Policy]:
    """Add the deprecated names `<prefix>_<name>` of the members `names` to a policy."""

    def decorate(policy: _Policy) -> _Policy:
        for name in names:
            setattr(policy, f"{prefix}_{name}", _DeprecatedAlias(f"{prefix}_{name}", name))
        return policy

    return decorate


@_deprecated_aliases("RMW_QOS_POLICY_HISTORY", ("SYSTEM_DEFAULT", "KEEP_LAST", "KEEP_ALL", "UNKNOWN"))
class HistoryPolicy(QoSPolicyEnum):
    """The number of samples to keep: the last `depth`, or all within the resource limits."""

    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3


@_deprecated_aliases("RMW_QOS_POLICY_RELIABILITY", ("SYSTEM_DEFAULT", "RELIABLE", "BEST_EFFORT", "UNKNOWN"))
class ReliabilityPolicy(QoSPolicyEnum):
    """Whether lost samples are sent again."""

    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


@_deprecated_aliases(
    "RMW_QOS_POLICY_DURABILITY", ("SYSTEM_DEFAULT", "TRANSIENT_LOCAL", "VOLATILE", "UNKNOWN")
)
class DurabilityPolicy(QoSPolicyEnum):
    """Whether a late subscription gets the samples that publishers keep."""

    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4


# rclpy also calls the alias of UNKNOWN DURABILITY.
@_deprecated_aliases("RMW_QOS_POLICY_DURABILITY", ("UNKNOWN",))
@_deprecated_aliases("RMW_QOS_POLICY_LIVELINESS", ("SYSTEM_DEFAULT", "AUTOMATIC", "MANUAL_BY_TOPIC"))
class LivelinessPolicy(QoSPolicyEnum):
    """Whether the process or each topic separately asserts that a publisher is alive."""

    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5


# The names before ROS 2 Foxy.
QoSHistoryPolicy = HistoryPolicy
QoSReliabilityPolicy = ReliabilityPolicy
QoSDurabilityPolicy = DurabilityPolicy
QoSLivelinessPolicy = LivelinessPolicy

_UNSPECIFIED = Duration()

DeadlineBestAvailable = Duration(nanoseconds=2**63 - 2)
"""The strictest deadline that matches most endpoints."""

LivelinessLeaseDurationeBestAvailable = Duration(nanoseconds=2**63 - 2)
"""The strictest lease duration that matches most endpoints. The spelling is that of rclpy."""


class QoSProfile:
    """A set of policies; a zero duration means "not specified"."""

    __slots__ = (
        "_history",
        "_depth",
        "_reliability",
        "_durability",
        "_lifespan",
        "_deadline",
        "_liveliness",
        "_liveliness_lease_duration",
        "_avoid_ros_namespace_conventions",
    )

    # Not hashable, because it is mutable, as in rclpy.
    __hash__ = None  # type: ignore[assignment]

    history = Checked(HistoryPolicy, "The samples to keep.", int)
    reliability = Checked(ReliabilityPolicy, "Whether lost samples are sent again.", int)
    durability = Checked(
        DurabilityPolicy, "Whether a late subscription gets the samples that publishers keep.", int
    )
    lifespan = Checked(Duration, "The age at which an undelivered sample is dropped.")
    deadline = Checked(Duration, "The longest time between two samples.")
    liveliness = Checked(
        LivelinessPolicy, "Whether the process or the topic asserts that a publisher is alive.", int
    )
    liveliness_lease_duration = Checked(
        Duration, "The time without an assertion after which a publisher is not alive."
    )
    avoid_ros_namespace_conventions = Checked(
        bool, "Whether the DDS topic has the name of the ROS topic, without the prefix `rt`."
    )

    def __init__(self, **kwargs: Any) -> None:
        """Create a profile from policies by name; other policies are those of `qos_profile_default`.

        :raises InvalidQoSProfileException: without `history` and `depth`, or for KEEP_LAST without `depth`.
        """
        assert all(f"_{key}" in self.__slots__ for key in kwargs), (
            f"Invalid arguments passed to constructor: {list(kwargs)}"
        )
        if "history" not in kwargs and "depth" not in kwargs:
            raise InvalidQoSProfileException("History and/or depth settings are required.")
        self.history = kwargs.get("history", HistoryPolicy.KEEP_LAST)
        if self.history == HistoryPolicy.KEEP_LAST and "depth" not in kwargs:
            raise InvalidQoSProfileException("History set to KEEP_LAST without a depth setting.")
        self.depth = kwargs.get("depth", 10)
        self.reliability = kwargs.get("reliability", ReliabilityPolicy.RELIABLE)
        self.durability = kwargs.get("durability", DurabilityPolicy.VOLATILE)
        self.lifespan = kwargs.get("lifespan", _UNSPECIFIED)
        self.deadline = kwargs.get("deadline", _UNSPECIFIED)
        self.liveliness = kwargs.get("liveliness", LivelinessPolicy.SYSTEM_DEFAULT)
        self.liveliness_lease_duration = kwargs.get("liveliness_lease_duration", _UNSPECIFIED)
        self.avoid_ros_namespace_conventions = kwargs.get("avoid_ros_namespace_conventions", False)

    @property
    def depth(self) -> int:
        """The number of samples that KEEP_LAST keeps."""
        return self._depth

    @depth.setter
    def depth(self, value: int) -> None:
        assert isinstance(value, int), f"depth must be an int, not {value!r}"
        if value == 0 and self.history == HistoryPolicy.KEEP_LAST:
            warnings.warn(
                "A zero depth with KEEP_LAST doesn't make sense; no data could be stored. "
                "This will be interpreted as SYSTEM_DEFAULT",
                stacklevel=2,
            )
        self._depth = value

    def get_c_qos_profile(self) -> NoReturn:
        """Raise NotImplementedError: there is no C layer."""
        raise NotImplementedError("QoSProfile.get_c_qos_profile: this runtime has no rmw_qos_profile_t")

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, QoSProfile):
            return False
        return all(getattr(self, slot) == getattr(other, slot) for slot in self.__slots__)

    def __str__(self) -> str:
        policies = ", ".join(f"{slot[1:]}={getattr(self, slot)}" for slot in self.__slots__)
        return f"{type(self).__name__}({policies})"

    def _rclpy_copy(self) -> QoSProfile:
        return QoSProfile(**{slot[1:]: getattr(self, slot) for slot in self.__slots__})


qos_profile_unknown = QoSProfile(
    history=HistoryPolicy.UNKNOWN,
    depth=0,
    reliability=ReliabilityPolicy.UNKNOWN,
    durability=DurabilityPolicy.UNKNOWN,
    liveliness=LivelinessPolicy.UNKNOWN,
)
"""No policy is known."""

qos_profile_default = QoSProfile(depth=10)
"""Reliable, volatile, last 10."""

qos_profile_system_default = QoSProfile(
    history=HistoryPolicy.SYSTEM_DEFAULT,
    depth=0,
    reliability=ReliabilityPolicy.SYSTEM_DEFAULT,
    durability=DurabilityPolicy.SYSTEM_DEFAULT,
)
"""Leaves the choice to the middleware."""

qos_profile_sensor_data = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Prefers fresh to complete data: best effort, last 5."""

qos_profile_services_default = QoSProfile(depth=10)
"""For requests and replies."""

qos_profile_parameters = QoSProfile(depth=1000)
"""For the parameter services, with a depth that avoids lost requests."""

qos_profile_parameter_events = QoSProfile(depth=1000)
"""For `/parameter_events`."""

qos_profile_best_available = QoSProfile(
    depth=10,
    reliability=ReliabilityPolicy.BEST_AVAILABLE,
    durability=DurabilityPolicy.BEST_AVAILABLE,
    deadline=DeadlineBestAvailable,
    liveliness=LivelinessPolicy.BEST_AVAILABLE,
    liveliness_lease_duration=LivelinessLeaseDurationeBestAvailable,
)
"""The strictest policies that match most endpoints known at the creation of the entity."""

qos_profile_action_status_default = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)
"""For the status topic of actions."""


class QoSPresetProfiles(Enum):
    """The presets by name; equal presets are one member."""

    UNKNOWN = qos_profile_unknown
    DEFAULT = qos_profile_default
    SYSTEM_DEFAULT = qos_profile_system_default
    SENSOR_DATA = qos_profile_sensor_data
    SERVICES_DEFAULT = qos_profile_services_default
    PARAMETERS = qos_profile_parameters
    PARAMETER_EVENTS = qos_profile_parameter_events
    ACTION_STATUS_DEFAULT = qos_profile_action_status_default
    BEST_AVAILABLE = qos_profile_best_available

    @classmethod
    def short_keys(cls) -> list[str]:
        return [name.lower() for name in cls.__members__]

    @classmethod
    def get_from_short_key(cls, name: str) -> QoSProfile:
        """Return the preset with that name, in upper or lower case. Raises KeyError if there is none."""
        return cls[name.upper()].value


class QoSCompatibility(IntEnum):
    """Whether a publisher and a subscription match. WARNING: it depends on unknown policies."""

    OK = 0
    WARNING = 1
    ERROR = 2


def qos_check_compatible(
    publisher_qos: QoSProfile, subscription_qos: QoSProfile
) -> tuple[QoSCompatibility, str]:
    """Return whether endpoints with these profiles match, and why not. Source: `rmw_dds_common`.

    The reasons end with semicolons. "System default" and "unknown" lead to warnings.
    """
    if errors := _incompatibilities(publisher_qos, subscription_qos):
        return QoSCompatibility.ERROR, "".join(f"ERROR: {error};" for error in errors)
    if doubts := _doubts(publisher_qos, subscription_qos):
        return QoSCompatibility.WARNING, "".join(f"WARNING: {doubt};" for doubt in doubts)
    return QoSCompatibility.OK, ""


def _incompatibilities(publisher: QoSProfile, subscription: QoSProfile) -> list[str]:
    """List the requests of the subscription that the publisher certainly does not offer."""
    errors = []
    if (publisher.reliability, subscription.reliability) == (
        ReliabilityPolicy.BEST_EFFORT,
        ReliabilityPolicy.RELIABLE,
    ):
        errors.append("Best effort publisher and reliable subscription")
    if (publisher.durability, subscription.durability) == (
        DurabilityPolicy.VOLATILE,
        DurabilityPolicy.TRANSIENT_LOCAL,
    ):
        errors.append("Volatile publisher and transient local subscription")
    if subscription.deadline != _UNSPECIFIED:
        if publisher.deadline == _UNSPECIFIED:
            errors.append("Subscription has a deadline, but publisher does not")
        elif subscription.deadline < publisher.deadline:
            errors.append("Subscription deadline is less than publisher deadline")
    if (publisher.liveliness, subscription.liveliness) == (
        LivelinessPolicy.AUTOMATIC,
        LivelinessPolicy.MANUAL_BY_TOPIC,
    ):
        errors.append("Publisher's liveliness is automatic and subscription's is manual by topic")
    if subscription.liveliness_lease_duration != _UNSPECIFIED:
        if publisher.liveliness_lease_duration == _UNSPECIFIED:
            errors.append("Subscription has a liveliness lease duration, but publisher does not")
        elif subscription.liveliness_lease_duration < publisher.liveliness_lease_duration:
            errors.append("Subscription liveliness lease duration is less than publisher")
    return errors


def _doubts(publisher: QoSProfile, subscription: QoSProfile) -> list[str]:
    """List the policies whose compatibility depends on an unknown value."""
    doubts = []
    for policy, weakest, strictest in (
        ("reliability", ReliabilityPolicy.BEST_EFFORT, ReliabilityPolicy.RELIABLE),
        ("durability", DurabilityPolicy.VOLATILE, DurabilityPolicy.TRANSIENT_LOCAL),
        ("liveliness", LivelinessPolicy.AUTOMATIC, LivelinessPolicy.MANUAL_BY_TOPIC),
    ):
        offered: QoSPolicyEnum = getattr(publisher, policy)
        requested: QoSPolicyEnum = getattr(subscription, policy)
        offer_known = offered.name not in ("SYSTEM_DEFAULT", "UNKNOWN")
        request_known = requested.name not in ("SYSTEM_DEFAULT", "UNKNOWN")
        if not offer_known and not request_known:
            offer = f"Publisher {policy} is {offered.short_key}"
            doubts.append(f"{offer} and subscription {policy} is {requested.short_key}")
        elif not offer_known and requested == strictest:
            doubts.append(f"{_sentence(strictest)} subscription, but publisher is {offered.short_key}")
        elif not request_known and offered == weakest:
            doubts.append(f"{_sentence(weakest)} publisher, but subscription is {requested.short_key}")
    return doubts


def _sentence(policy: QoSPolicyEnum) -> str:
    return policy.short_key.replace("_", " ").capitalize()
