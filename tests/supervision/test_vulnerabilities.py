from __future__ import annotations

import pytest

from deploy.supervision import vulnerabilities

SUBNET = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
LOCALHOST = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


@pytest.fixture(autouse=True)
def wheels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vulnerabilities.rclpy_choice, "sourced_rclpy", lambda: "")
    monkeypatch.setattr(vulnerabilities, "version", lambda _: "2.14.5")


@pytest.mark.parametrize("reach", [SUBNET, {}, LOCALHOST | {"ROS_STATIC_PEERS": "10.0.0.7"}])
def test_the_wheels_warn_if_other_hosts_reach_them(reach: dict[str, str]) -> None:
    warning = vulnerabilities.warning(reach)
    assert warning.startswith(
        "WARNING: other hosts reach Fast DDS 2.14.5, which lacks the fixes of 17 known "
    )
    assert "ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST" in warning


@pytest.mark.parametrize("environment", [LOCALHOST, SUBNET | {"RUNTIME": "cyclonedds"}])
def test_nobody_is_warned_who_is_alone_or_on_another_middleware(environment: dict[str, str]) -> None:
    assert vulnerabilities.warning(environment) == ""


@pytest.mark.parametrize("version", ["2.14.7", "2.14.10", "3.2.5"])
def test_the_warning_ends_with_the_release_that_has_the_fixes(
    version: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(vulnerabilities, "version", lambda _: version)
    assert vulnerabilities.warning(SUBNET) == ""


def test_a_sourced_ros_2_is_not_judged_by_the_wheels(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(vulnerabilities.rclpy_choice, "sourced_rclpy", lambda: "/opt/ros/rclpy")
    assert vulnerabilities.warning(SUBNET) == ""
