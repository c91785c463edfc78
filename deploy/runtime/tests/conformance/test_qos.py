from __future__ import annotations

import pytest

from rclpy import qos
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    InvalidQoSProfileException,
    LivelinessPolicy,
    QoSCompatibility,
    QoSPolicyKind,
    QoSPresetProfiles,
    QoSProfile,
    ReliabilityPolicy,
    qos_check_compatible,
)


def test_a_profile_needs_a_depth_unless_it_keeps_all() -> None:
    assert QoSProfile(depth=3).history == HistoryPolicy.KEEP_LAST
    assert QoSProfile(history=HistoryPolicy.KEEP_ALL).depth == 10
    with pytest.raises(InvalidQoSProfileException, match="History and/or depth"):
        QoSProfile()
    with pytest.raises(InvalidQoSProfileException, match="KEEP_LAST without a depth"):
        QoSProfile(history=HistoryPolicy.KEEP_LAST)


def test_missing_policies_come_from_the_default_profile() -> None:
    assert QoSProfile(depth=10) == qos.qos_profile_default


def test_policies_may_be_given_as_numbers() -> None:
    profile = QoSProfile(depth=1, reliability=2)
    assert profile.reliability is ReliabilityPolicy.BEST_EFFORT
    with pytest.raises(ValueError, match="17 is not a valid"):
        QoSProfile(depth=1, durability=17)


@pytest.mark.parametrize(
    "arguments",
    [
        {"depth": "1"},
        {"depth": 1, "colour": "red"},
        {"depth": 1, "lifespan": 1.0},
        {"depth": 1, "reliability": "reliable"},
        {"depth": 1, "avoid_ros_namespace_conventions": 1},
    ],
)
def test_a_policy_of_a_wrong_type_or_name_is_an_error(arguments: dict[str, object]) -> None:
    with pytest.raises(AssertionError):
        QoSProfile(**arguments)


def test_a_depth_of_zero_warns() -> None:
    with pytest.warns(UserWarning, match="zero depth"):
        QoSProfile(depth=0)


def test_profiles_with_equal_policies_are_equal_and_have_no_hash() -> None:
    assert QoSProfile(depth=1) == QoSProfile(depth=1)
    assert QoSProfile(depth=1) != QoSProfile(depth=1, deadline=Duration(seconds=1))
    assert QoSProfile(depth=1) != 1
    with pytest.raises(TypeError, match="unhashable"):
        hash(QoSProfile(depth=1))


def test_short_keys_ignore_case() -> None:
    assert ReliabilityPolicy.short_keys() == [
        "system_default",
        "reliable",
        "best_effort",
        "unknown",
        "best_available",
    ]
    assert ReliabilityPolicy.get_from_short_key("Best_Effort") == ReliabilityPolicy.BEST_EFFORT
    assert LivelinessPolicy.MANUAL_BY_TOPIC.short_key == "manual_by_topic"
    assert "services_default" in QoSPresetProfiles.short_keys()
    assert QoSPresetProfiles.get_from_short_key("Sensor_Data") is qos.qos_profile_sensor_data
    with pytest.raises(KeyError):
        DurabilityPolicy.get_from_short_key("forever")


def test_deprecated_names_still_work_and_warn() -> None:
    assert qos.QoSReliabilityPolicy is ReliabilityPolicy
    with pytest.warns(UserWarning, match=r"Use HistoryPolicy\.KEEP_ALL instead"):
        assert HistoryPolicy.RMW_QOS_POLICY_HISTORY_KEEP_ALL is HistoryPolicy.KEEP_ALL  # type: ignore[attr-defined]


def test_a_policy_kind_has_a_name() -> None:
    assert qos.qos_policy_name_from_kind(QoSPolicyKind.LIFESPAN) == "LIFESPAN"
    assert qos.qos_policy_name_from_kind(2) == "DURABILITY"


def profile(**policies: object) -> QoSProfile:
    return QoSProfile(**{"depth": 1, "liveliness": LivelinessPolicy.AUTOMATIC, **policies})


def test_equal_profiles_are_compatible() -> None:
    assert qos_check_compatible(profile(), profile()) == (QoSCompatibility.OK, "")


@pytest.mark.parametrize(
    ("publisher", "subscription", "reason"),
    [
        (
            {"reliability": ReliabilityPolicy.BEST_EFFORT},
            {"reliability": ReliabilityPolicy.RELIABLE},
            "ERROR: Best effort publisher and reliable subscription;",
        ),
        (
            {"durability": DurabilityPolicy.VOLATILE},
            {"durability": DurabilityPolicy.TRANSIENT_LOCAL},
            "ERROR: Volatile publisher and transient local subscription;",
        ),
        (
            {},
            {"deadline": Duration(seconds=1)},
            "ERROR: Subscription has a deadline, but publisher does not;",
        ),
        (
            {"deadline": Duration(seconds=2)},
            {"deadline": Duration(seconds=1)},
            "ERROR: Subscription deadline is less than publisher deadline;",
        ),
        (
            {"liveliness": LivelinessPolicy.AUTOMATIC},
            {"liveliness": LivelinessPolicy.MANUAL_BY_TOPIC},
            "ERROR: Publisher's liveliness is automatic and subscription's is manual by topic;",
        ),
        (
            {},
            {"liveliness_lease_duration": Duration(seconds=1)},
            "ERROR: Subscription has a liveliness lease duration, but publisher does not;",
        ),
        (
            {"liveliness_lease_duration": Duration(seconds=2)},
            {"liveliness_lease_duration": Duration(seconds=1)},
            "ERROR: Subscription liveliness lease duration is less than publisher;",
        ),
        (
            {"reliability": ReliabilityPolicy.SYSTEM_DEFAULT},
            {"reliability": ReliabilityPolicy.UNKNOWN},
            "WARNING: Publisher reliability is system_default and subscription reliability is unknown;",
        ),
        (
            {"durability": DurabilityPolicy.UNKNOWN},
            {"durability": DurabilityPolicy.TRANSIENT_LOCAL},
            "WARNING: Transient local subscription, but publisher is unknown;",
        ),
        (
            {"reliability": ReliabilityPolicy.BEST_EFFORT},
            {"reliability": ReliabilityPolicy.SYSTEM_DEFAULT},
            "WARNING: Best effort publisher, but subscription is system_default;",
        ),
    ],
)
def test_what_is_or_may_be_requested_in_vain_is_reported(
    publisher: dict[str, object], subscription: dict[str, object], reason: str
) -> None:
    result = qos_check_compatible(profile(**publisher), profile(**subscription))
    assert result == (getattr(QoSCompatibility, reason.partition(":")[0]), reason)


def test_requesting_less_than_offered_is_compatible() -> None:
    publisher = profile(
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        deadline=Duration(seconds=1),
        liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
    )
    subscription = profile(reliability=ReliabilityPolicy.BEST_EFFORT, deadline=Duration(seconds=2))
    assert qos_check_compatible(publisher, subscription)[0] == QoSCompatibility.OK


def test_every_incompatible_policy_is_reported() -> None:
    publisher = profile(reliability=ReliabilityPolicy.BEST_EFFORT)
    subscription = profile(durability=DurabilityPolicy.TRANSIENT_LOCAL)
    assert qos_check_compatible(publisher, subscription)[1].count("ERROR:") == 2
