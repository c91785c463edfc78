from __future__ import annotations

from typing import Any

import pytest
from deploy.runtime.tests.nodes import MakeNode

from rcl_interfaces.msg import SetParametersResult
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import (
    HistoryPolicy,
    LivelinessPolicy,
    QoSPolicyKind,
    QoSProfile,
    ReliabilityPolicy,
    qos_profile_unknown,
)
from rclpy.qos_overriding_options import (
    InvalidQosOverridesError,
    QoSOverridingOptions,
    _declare_qos_parameters,
)
from rclpy.subscription import Subscription


def overrides(entity: str, **policies: Any) -> list[Parameter]:
    return [
        Parameter(f"qos_overrides./chatter.{entity}.{name}", value=value) for name, value in policies.items()
    ]


def declare(
    node: Node, qos: QoSProfile, options: QoSOverridingOptions, entity: Any = Publisher
) -> dict[str, Any]:
    """Declare the parameters; return the values of all, by their names below the topic."""
    _declare_qos_parameters(entity, node, "/chatter", qos, options)
    parameters = node.get_parameters_by_prefix("qos_overrides./chatter")
    return {name: parameter.value for name, parameter in parameters.items()}


def test_default_policies_are_declared_with_the_values_of_the_profile(node: Node) -> None:
    qos = QoSProfile(depth=7)
    assert declare(node, qos, QoSOverridingOptions.with_default_policies()) == {
        "publisher.history": "keep_last",
        "publisher.depth": 7,
        "publisher.reliability": "reliable",
    }
    assert qos == QoSProfile(depth=7)
    descriptor = node.describe_parameter("qos_overrides./chatter.publisher.depth")
    assert descriptor.read_only
    assert descriptor.description == "depth for publisher `/chatter` with id `None`"


def test_overrides_change_the_profile(make_node: MakeNode) -> None:
    parameters = overrides(
        "subscription_left",
        history="KEEP_ALL",
        reliability="best_effort",
        liveliness="manual_by_topic",
        deadline=5_000_000,
        avoid_ros_namespace_conventions=True,
    )
    node = make_node(parameter_overrides=parameters)
    qos = QoSProfile(depth=1)
    kinds = [kind for kind in QoSPolicyKind if kind is not QoSPolicyKind.INVALID]
    declared = declare(node, qos, QoSOverridingOptions(kinds, entity_id="left"), Subscription)
    assert "subscription_left.lifespan" not in declared
    assert len(declared) == 8
    assert qos.history is HistoryPolicy.KEEP_ALL
    assert qos.reliability is ReliabilityPolicy.BEST_EFFORT
    assert qos.liveliness is LivelinessPolicy.MANUAL_BY_TOPIC
    assert qos.deadline == Duration(nanoseconds=5_000_000)
    assert qos.avoid_ros_namespace_conventions


def test_a_second_entity_of_the_same_name_shares_the_parameters(make_node: MakeNode) -> None:
    node = make_node(parameter_overrides=overrides("publisher", depth=3))
    options = QoSOverridingOptions.with_default_policies()
    for _ in range(2):
        qos = QoSProfile(depth=1)
        declare(node, qos, options)
        assert qos.depth == 3


def test_an_unknown_value_of_a_policy_is_refused(make_node: MakeNode) -> None:
    node = make_node(parameter_overrides=overrides("publisher", reliability="perfect"))
    with pytest.raises(RuntimeError, match="`reliability`: `perfect`"):
        declare(node, QoSProfile(depth=1), QoSOverridingOptions.with_default_policies())


def test_an_unknown_profile_is_refused(node: Node) -> None:
    with pytest.raises(ValueError, match="invalid"):
        declare(node, qos_profile_unknown._rclpy_copy(), QoSOverridingOptions.with_default_policies())


def test_a_callback_accepts_or_refuses_the_whole_profile(make_node: MakeNode) -> None:
    seen = []

    def deep_enough(qos: QoSProfile) -> SetParametersResult:
        seen.append(qos.depth)
        return SetParametersResult(successful=qos.depth > 5, reason="too shallow")

    options = QoSOverridingOptions.with_default_policies(callback=deep_enough, entity_id="x")
    declare(make_node(), QoSProfile(depth=10), options)
    with pytest.raises(InvalidQosOverridesError, match="with id `x`, are not valid: too shallow"):
        declare(make_node(), QoSProfile(depth=1), options)
    assert seen == [10, 1]


def test_only_publishers_and_subscriptions_have_overrides(node: Node) -> None:
    with pytest.raises(TypeError, match="entity_type"):
        declare(node, QoSProfile(depth=1), QoSOverridingOptions.with_default_policies(), str)
