"""How a service keeps Fast DDS from shared memory."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from interfaces.service import middleware

FASTDDS = Path("deploy/fastdds.xml").resolve()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ("SYSTEM_DEFAULT", FASTDDS.with_name("fastdds.localhost.xml"))),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, ("SUBNET", FASTDDS)),
        ({"ROS_STATIC_PEERS": "192.0.2.1"}, ("LOCALHOST", FASTDDS)),
        ({"FASTRTPS_DEFAULT_PROFILES_FILE": "/users.xml"}, ("LOCALHOST", Path("/users.xml"))),
    ],
)
def test_only_our_settings_for_this_machine_change(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, str], expected: tuple[str, Path]
) -> None:
    settings = {middleware.RANGE: "LOCALHOST", middleware.PROFILES: str(FASTDDS), middleware.PEERS: ""}
    for name, value in (settings | changes).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(middleware, "get_rmw_implementation_identifier", lambda: "rmw_fastrtps_cpp")
    middleware.avoid_shared_memory()
    assert (os.environ[middleware.RANGE], Path(os.environ[middleware.PROFILES])) == expected


def test_other_middleware_keeps_the_range(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(middleware.RANGE, "LOCALHOST")
    monkeypatch.setenv(middleware.PROFILES, str(FASTDDS))
    monkeypatch.setattr(middleware, "get_rmw_implementation_identifier", lambda: "rmw_cyclonedds_cpp")
    middleware.avoid_shared_memory()
    assert os.environ[middleware.RANGE] == "LOCALHOST"
