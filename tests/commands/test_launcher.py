from __future__ import annotations

from pathlib import Path

import pytest

from deploy.commands.launcher import place
from deploy.running.errors import DeploymentError
from deploy.running.system import System


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


@pytest.mark.parametrize("written", [None, b"", b"{", b"\xff", b"/**: 1", b"/**: {ros__parameters: {}}"])
def test_damaged_parameters_of_a_running_system_are_one_line(tmp_path: Path, written: bytes | None) -> None:
    system = System(tmp_path)
    if written is not None:
        system.parameters.write_bytes(written)
    for use in (system.origin, lambda: system.keep_origin(1.0)):
        with pytest.raises(DeploymentError) as raised:
            use()
        assert str(raised.value) == f"{system.parameters} was deleted or damaged: make stop, make start"
