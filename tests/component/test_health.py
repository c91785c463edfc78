"""Reading health reports."""

from __future__ import annotations

from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from interfaces.service.health import healths

GOOD = {"pid": "7", "published": "3", "seconds_since_output": "0.5"}


def message(name: str, values: dict[str, Any]) -> DiagnosticArray:
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    return DiagnosticArray(status=[DiagnosticStatus(name=name, message="running", values=pairs)])


def test_report_of_a_service_in_the_namespace_is_read() -> None:
    health = healths(message("/arm1/velocity", GOOD), "/arm1")["velocity"]
    assert (health.pid, health.ok, health.reason, health.since_output) == (7, True, "running", 0.5)
    silent = healths(message("/velocity", GOOD | {"seconds_since_output": ""}), "")["velocity"]
    assert silent.since_output is None


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("/arm2/velocity", GOOD),
        ("/velocity", GOOD),
        ("/arm1/battery", {"pid": "7"}),
        ("/arm1/battery", GOOD | {"pid": "none"}),
        ("/arm1/battery", GOOD | {"seconds_since_output": "long ago"}),
        ("", {}),
    ],
)
def test_other_statuses_are_ignored(name: str, values: dict[str, Any]) -> None:
    assert healths(message(name, values), "/arm1") == {}
