"""The embedded runtime against the recorded API of rclpy, and the runtime's README against both."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest
from deploy.runtime.tests.runtime import conformance

from rclpy.node import Node

README = Path(__file__).parents[2] / "README.md"


def test_nothing_of_rclpys_public_api_is_missing() -> None:
    rows = conformance.modules()
    print(conformance.table(rows))
    assert {row.name: row.missing for row in rows if row.missing} == {}


def test_no_class_has_more_than_rclpys() -> None:
    assert conformance.surplus() == []


def test_the_readme_says_what_is_supported() -> None:
    assert conformance.table(conformance.modules()) in README.read_text(), (
        "the table in README.md is out of date: python -m deploy.runtime.tests.runtime.conformance"
    )


@pytest.mark.parametrize(
    ("module", "names"),
    [
        (
            "rclpy.action",
            "ActionClient ActionServer CancelResponse GoalResponse get_action_names_and_types"
            " get_action_client_names_and_types_by_node get_action_server_names_and_types_by_node",
        ),
        (
            "rclpy.lifecycle",
            "LifecycleNode LifecycleNodeMixin LifecycleState LifecyclePublisher ManagedEntity"
            " SimpleManagedEntity TransitionCallbackReturn",
        ),
    ],
)
def test_what_is_not_there_says_so_by_its_name_when_it_is_used(module: str, names: str) -> None:
    for name in names.split():
        with pytest.raises(
            NotImplementedError, match=rf"^{module}\.{name}: the embedded runtime has no"
        ) as told:
            getattr(importlib.import_module(module), name)("anything", at="all")
        assert "\n" not in str(told.value)


def test_a_class_of_ones_own_names_what_it_lacks() -> None:
    lifecycle = importlib.import_module("rclpy.lifecycle")
    for base in (lifecycle.Node, lifecycle.NodeMixin):
        mine = type("Mine", (base, Node), {"__init__": lambda self: None})
        with pytest.raises(NotImplementedError, match=rf"^rclpy\.lifecycle\.{base.__name__}: "):
            mine()
