"""What the launcher prints."""

from __future__ import annotations

import pytest

from deploy.commands.launcher import place


@pytest.mark.parametrize(
    ("environment", "words"),
    [
        ({}, "ROS domain 0"),
        ({"ROS_DOMAIN_ID": "", "REACTIVE_ARM_NAMESPACE": ""}, "ROS domain 0"),
        ({"ROS_DOMAIN_ID": "7", "REACTIVE_ARM_NAMESPACE": "/arm1"}, "ROS domain 7, namespace /arm1"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, "ROS domain 0"),
        ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}, "ROS domain 0, discovery range SUBNET"),
    ],
)
def test_start_tells_what_is_not_as_ever(environment: dict[str, str], words: str) -> None:
    assert place(environment) == words
