"""QoS by configuration: what is declared, what it does, and what is refused."""

from __future__ import annotations

from typing import Any

import pytest

from rcl_interfaces.msg import SetParametersResult
from rclpy._node_parameters import NodeParameters
from rclpy.clock import ROSClock
from rclpy.duration import Duration
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


class Node(NodeParameters):
    """A node that is nothing but its parameters."""

    def __init__(self, **overrides: Any) -> None:
        self._rclpy_init_parameters(
            {name: Parameter(name, value=value) for name, value in overrides.items()}, allow_undeclared=False
        )

    def get_fully_qualified_name(self) -> str:
        return "/node"

    def get_clock(self) -> ROSClock:
        return ROSClock()

    def _rclpy_publish_parameter_event(self, event: object) -> None:
        pass


def declare(
    node: Node, qos: QoSProfile, options: QoSOverridingOptions, entity: Any = Publisher
) -> dict[str, Any]:
    """Declare the parameters and return all there are by the rest of their names."""
    _declare_qos_parameters(entity, node, "/chatter", qos, options)  # type: ignore[arg-type]
    parameters = node.get_parameters_by_prefix("qos_overrides./chatter")
    return {name: parameter.value for name, parameter in parameters.items()}


def test_the_default_policies_are_declared_with_the_profile_as_default() -> None:
    node, qos = Node(), QoSProfile(depth=7)
    assert declare(node, qos, QoSOverridingOptions.with_default_policies()) == {
        "publisher.history": "keep_last",
        "publisher.depth": 7,
        "publisher.reliability": "reliable",
    }
    assert qos == QoSProfile(depth=7)
    descriptor = node.describe_parameter("qos_overrides./chatter.publisher.depth")
    assert descriptor.read_only
    assert descriptor.description == "depth for publisher `/chatter` with id `None`"


def test_overrides_change_the_profile() -> None:
    prefix = "qos_overrides./chatter.subscription_left"
    node = Node(
        **{
            f"{prefix}.history": "KEEP_ALL",
            f"{prefix}.reliability": "best_effort",
            f"{prefix}.liveliness": "manual_by_topic",
            f"{prefix}.deadline": 5_000_000,
            f"{prefix}.avoid_ros_namespace_conventions": True,
        }
    )
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


def test_a_second_entity_of_the_same_name_shares_the_parameters() -> None:
    node = Node(**{"qos_overrides./chatter.publisher.depth": 3})
    options = QoSOverridingOptions.with_default_policies()
    for _ in range(2):
        qos = QoSProfile(depth=1)
        declare(node, qos, options)
        assert qos.depth == 3


def test_a_value_that_a_policy_does_not_have_is_refused() -> None:
    node = Node(**{"qos_overrides./chatter.publisher.reliability": "perfect"})
    with pytest.raises(RuntimeError, match="`reliability`: `perfect`"):
        declare(node, QoSProfile(depth=1), QoSOverridingOptions.with_default_policies())


def test_a_profile_that_is_unknown_is_refused() -> None:
    with pytest.raises(ValueError, match="invalid"):
        declare(Node(), qos_profile_unknown._copy(), QoSOverridingOptions.with_default_policies())


def test_the_callback_decides_about_the_whole_profile() -> None:
    seen = []

    def deep_enough(qos: QoSProfile) -> SetParametersResult:
        seen.append(qos.depth)
        return SetParametersResult(successful=qos.depth > 5, reason="too shallow")

    options = QoSOverridingOptions.with_default_policies(callback=deep_enough, entity_id="x")
    declare(Node(), QoSProfile(depth=10), options)
    with pytest.raises(InvalidQosOverridesError, match="with id `x`, are not valid: too shallow"):
        declare(Node(), QoSProfile(depth=1), options)
    assert seen == [10, 1]


def test_only_publishers_and_subscriptions_have_overrides() -> None:
    with pytest.raises(TypeError, match="entity_type"):
        declare(Node(), QoSProfile(depth=1), QoSOverridingOptions.with_default_policies(), str)
