"""Mistakes of a user: one line says what is wrong, and nothing starts."""

from __future__ import annotations

import os
import re
import sys
import time
from pathlib import Path

import pytest
from rclpy.utilities import get_rmw_implementation_identifier

from interfaces.service import instance
from tests.system.sites import STEADY, Site

FILES = [
    ("scenario", "l3: 1.0", "scenario: unknown key 'l3'"),
    ("scenario", "l1: [", "line 2, column 1: "),
    ("manifest", "[program:drive]\ncommand = x", "[program:drive] has the name of a program of the arm"),
    ("parameters", "velocity: {ros__parameters: {rate: 1.0}}", "velocity.rate: is no parameter"),
    (
        "parameters",
        "operator_page: {ros__parameters: {certificate: it.pem}}",
        "operator_page: certificate '{folder}/it.pem': No such file or directory",
    ),
    (
        "parameters",
        "operator_page: {ros__parameters: {certificate: /it.pem, key: /k}}",
        "operator_page: certificate '/it.pem' or key '/k': No such file or directory",
    ),
]


@pytest.mark.parametrize(("kind", "text", "complaint"), FILES)
def test_an_error_in_a_file_is_reported_before_the_start(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str, text: str, complaint: str
) -> None:
    file = tmp_path / "mine"
    file.write_text(text)
    if kind == "manifest":
        monkeypatch.setenv("MANIFEST", str(file))
    more = {"scenario": [str(file)], "parameters": [STEADY, str(file)]}.get(kind, [STEADY])
    code, printed = site.do("start", *more)
    assert code == 1
    assert printed.startswith(f"{file}: {complaint.format(folder=tmp_path)}")
    assert "\n" not in printed
    assert not site.run.exists()


def test_an_unknown_scenario_is_reported_with_the_known_ones(site: Site) -> None:
    assert site.do("run", "tango") == (
        1,
        "SCENARIO=tango is neither a file nor one of: demo, listing_5_9, none",
    )


def test_a_quote_in_scenario_is_no_shell_syntax(site: Site) -> None:
    code, printed = site.do_command("make", "start", "SCENARIO=it's")
    assert code != 0
    assert printed.startswith("SCENARIO=it's is neither a file nor one of: demo, listing_5_9")


@pytest.mark.parametrize(
    ("variable", "complaint"),
    [
        ("ROS_DOMAIN_ID=233", " is not a number from 0 to 232"),
        ("ROS_AUTOMATIC_DISCOVERY_RANGE=OFF", " keeps the services apart: set LOCALHOST or SUBNET"),
        ("REACTIVE_ARM_NAMESPACE=arm 1", " is no namespace such as /arm1: "),
    ],
)
def test_a_variable_without_sense_is_reported_before_the_start(
    site: Site, variable: str, complaint: str
) -> None:
    code, printed = site.do_command("env", variable, *site.command(("run", STEADY)))
    assert code == 1
    assert printed.startswith(variable + complaint)
    assert "\n" not in printed
    assert not site.run.exists()


def test_a_loopback_that_is_down_is_reported(site: Site) -> None:
    launcher = [sys.executable, "-m", "deploy.commands.launcher", "start", STEADY]
    code, printed = site.do_command("unshare", "--net", "--map-root-user", *launcher)
    if printed.startswith("unshare:"):
        pytest.skip(f"platform: {printed}")
    assert code == 1
    assert re.fullmatch("Cannot join the ROS graph: the .* is down.*ip link set lo up.?", printed)
    assert site.members == {}


@pytest.mark.skipif(
    get_rmw_implementation_identifier() != "rmw_cyclonedds_cpp", reason="platform: another DDS than Cyclone"
)
def test_an_impossible_dds_configuration_is_reported(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<no xml")
    code, printed = site.do("run", STEADY)
    assert code == 1
    assert printed.splitlines()[-1].startswith("Cannot join the ROS graph: ")
    assert "Traceback" not in printed
    assert not site.run.exists()


def test_a_run_directory_that_cannot_be_made_is_reported(site: Site, tmp_path: Path) -> None:
    site.run = tmp_path / "file" / "run"
    site.run.parent.touch()
    reason = f"The run directory {site.run} cannot be made: Not a directory."
    expected = 1, f"{reason} Set REACTIVE_ARM_RUN_DIR to another one."
    assert site.do("start", STEADY) == expected
    site.run.parent.unlink()


def test_a_full_disk_is_reported_with_the_file(site: Site) -> None:
    site.run.mkdir()
    (site.run / "parameters.new").symlink_to("/dev/full")
    assert site.do("start", STEADY) == (1, f"{site.run / 'parameters.yaml'}: No space left on device")
    assert site.members == {}


def test_a_service_in_the_same_domain_is_reported(site: Site) -> None:
    # In the environment of conftest.py: it is killed, and leaves no shared memory behind.
    service = site.begin_alone([sys.executable, "-m", "services.velocity"], {**os.environ})
    while not instance.holders("/velocity", site.domain):
        assert service.is_alive, service.output
        time.sleep(0.02)
    code, printed = site.do("start", STEADY)
    assert code == 1
    assert printed.startswith(f"ROS domain {site.domain} is in use: /velocity already runs on this host. Set")


def test_the_sentinel_runs_only_under_supervisord(site: Site) -> None:
    code, printed = site.do_command(sys.executable, "-m", "deploy.supervision.sentinel")
    assert (code, printed) == (2, "sentinel: runs only under supervisord: make start")


def test_a_disk_without_space_for_a_log_is_reported(site: Site) -> None:
    site.run.mkdir()
    fill = 'mount -t tmpfs -o size=64k,mode=700 tmpfs "$0" && head -c 61440 /dev/zero >"$0/fill" && exec "$@"'
    launcher = [sys.executable, "-m", "deploy.commands.launcher", "start", STEADY]
    code, printed = site.do_command(
        "unshare", "--mount", "--map-root-user", "sh", "-c", fill, str(site.run), *launcher
    )
    if printed.startswith(("unshare:", "mount:")):
        pytest.skip(f"platform: {printed}")
    space = f"It gave no reason; 0 kB are free on the disk of {site.run}"
    assert (code, printed) == (1, f"supervisord does not start:\n{space}")
