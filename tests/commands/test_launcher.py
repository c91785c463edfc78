from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.commands.launcher import place
from deploy.supervision.errors import DeploymentError
from deploy.supervision.system import System


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
def test_start_reports_what_is_not_as_ever(environment: dict[str, str], words: str) -> None:
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


@pytest.mark.parametrize(
    ("module", "command", "arguments"),
    [("launcher", "status", ["status"]), ("launcher", "logs", ["logs"]), ("fleet", "run", [])],
)
def test_text_that_the_locale_cannot_show_ends_no_command(
    module: str, command: str, arguments: list[str]
) -> None:
    show = f"{module}.{command} = lambda _: print('\\u03b8 = 1'); {module}.main({arguments})"
    done = subprocess.run(
        [sys.executable, "-c", f"from deploy.commands import {module}; {show}"],
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
    )
    assert (done.stdout, done.stderr) == (b"\\u03b8 = 1\n", b"")
