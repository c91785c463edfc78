"""The API of the embedded runtime agrees with that of ROS 2's rclpy, and README.md with both."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import pytest
from deploy.runtime.tests.runtime import conformance

pytestmark = pytest.mark.filterwarnings("ignore:rclpy.qos_event is deprecated")
README = Path(__file__).parents[2] / "README.md"


def test_public_api_of_rclpy_is_complete() -> None:
    rows = conformance.modules()
    print(conformance.table(rows))
    assert {row.name: row.missing for row in rows if row.missing} == conformance.MISSING


def test_enumerations_have_the_members_of_rclpy() -> None:
    for module, entries in conformance.api().items():
        for name, facts in entries.items():
            if "members" in facts and name != "FutureState":
                cls = getattr(importlib.import_module(module), name)
                assert {member.name: str(member.value) for member in cls} == facts["members"], name


def test_no_class_has_more_members_than_in_rclpy() -> None:
    assert conformance.surplus() == []


@pytest.mark.parametrize("rows", [conformance.modules, conformance.tools])
def test_readme_has_the_current_tables(rows: Callable[[], list[conformance.Module]]) -> None:
    assert conformance.table(rows()) in README.read_text(), (
        "a table in README.md is out of date: replace it with the output of"
        " RUNTIME=embedded deploy/commands/venv.sh -m deploy.runtime.tests.runtime.conformance"
    )
