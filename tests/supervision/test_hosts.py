"""The manifest of one of two hosts, and the sentinels of both."""

from __future__ import annotations

import os
import socket
import sys
from pathlib import Path

import pytest
from diagnostic_msgs.msg import DiagnosticArray

from deploy.supervision import manifest, sentinel
from deploy.supervision.errors import DeploymentError
from deploy.supervision.probe import Probe
from deploy.supervision.supervisord import Program, Supervisord
from interfaces.service.health import Health


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    """The environment and the path of imports are as before after each test."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in (manifest.VARIABLE, "PYTHONPATH"):
        monkeypatch.setenv(name, os.environ.get(name, ""))


OPERATORS = {"dead_mans_switch", "operator_page"}


def names(host: str, own: str = "") -> tuple[list[str], set[str]]:
    """Return the programs that run on a host, and those of all hosts as that host knows them."""
    with manifest.chosen(own, host=host):
        return [each.name for each in manifest.programs()], {each.name for each in manifest.everywhere()}


def test_each_program_runs_on_one_host_and_each_host_has_a_sentinel() -> None:
    everything = {each.name for each in manifest.programs()} - {manifest.SENTINEL}
    robot, known_to_robot = names("robot")
    operator, known_to_operator = names("operator")
    assert set(operator) == OPERATORS | {"sentinel_operator"}
    assert set(robot) == everything - OPERATORS | {"sentinel_robot"}
    assert known_to_robot == known_to_operator == {*robot, *operator}


def test_one_host_runs_all_by_default() -> None:
    assert manifest.everywhere() == manifest.programs()
    assert manifest.SENTINEL in {each.name for each in manifest.programs()}


def test_node_of_a_sentinel_has_the_name_of_its_program() -> None:
    with manifest.chosen("", host="operator"):
        assert " __node:=sentinel_operator" in manifest.path().read_text()
        (page,) = (each for each in manifest.programs() if each.name == manifest.PAGE)
        assert page.host == "operator"


def test_program_of_the_user_runs_on_the_robot_unless_it_names_a_host(tmp_path: Path) -> None:
    own = tmp_path / "robot.conf"
    command = "command = python3 -m services.examples.speed_guard\n"
    own.write_text(f"[program:guard]\n{command}[program:alarm]\n{command}host = operator\n")
    assert "guard" in names("robot", str(own))[0]
    assert "alarm" in names("operator", str(own))[0]
    assert {"guard", "alarm"} <= names("operator", str(own))[1]


def test_health_of_a_process_of_another_host_is_not_taken_for_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    supervisord = Supervisord(os.getppid())
    monkeypatch.setattr(supervisord, "watch", lambda: [Program("drive", "RUNNING", 7, 0.0, 0, "", "")])
    probe = Probe(tmp_path, supervisord)
    for host in ("elsewhere", socket.gethostname()):
        probe.hear({"drive": Health(5.0, 7, True, "running", None, host=host)})
        assert probe.observe().last_health == ({} if host == "elsewhere" else {("drive", 7): 5.0})


def test_host_without_programs_is_refused_in_one_line() -> None:
    with pytest.raises(DeploymentError, match=r"^HOST=moon has no programs; the hosts are operator, robot$"):
        names("moon")


@pytest.mark.parametrize(
    ("host", "name"), [("", "sentinel"), ("robot", "sentinel_robot"), ("operator", "sentinel_operator")]
)
def test_sentinel_is_named_after_its_host(host: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(manifest.HOST, host)
    assert manifest.sentinel() == name


@pytest.mark.parametrize(
    ("node", "is_read"),
    [
        ("/arm1/sentinel", True),
        ("/arm1/sentinel_operator", True),
        ("/arm2/sentinel_operator", False),
        ("/arm1/velocity", False),
    ],
)
def test_states_of_all_sentinels_of_an_arm_are_read(node: str, is_read: bool) -> None:
    program = Program("drive", "RUNNING", 7, 1.0, 0, "", "")
    message = DiagnosticArray(status=sentinel.states([program], {}, {}, node))
    assert [each.name for each in sentinel.reported(message, "/arm1")] == ["drive"] * is_read
