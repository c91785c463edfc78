"""The embedded runtime against the recorded API of rclpy, and the runtime's README against both."""

from __future__ import annotations

from pathlib import Path

from tests.runtime import conformance

README = Path(__file__).parents[2] / "deploy" / "runtime" / "README.md"


def test_nothing_of_rclpys_public_api_is_missing() -> None:
    rows = conformance.modules()
    print(conformance.table(rows))
    assert {row.name: row.missing for row in rows if row.missing} == {}


def test_no_class_has_more_than_rclpys() -> None:
    assert conformance.surplus() == []


def test_the_readme_says_what_is_supported() -> None:
    assert conformance.table(conformance.modules()) in README.read_text(), (
        "the table in deploy/runtime/README.md is out of date: python -m tests.runtime.conformance"
    )
