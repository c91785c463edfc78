"""What a start finds out about other hosts of its arm: their programs and their clocks."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from functools import partial
from types import SimpleNamespace

import pytest

from deploy.commands import hosts
from deploy.commands.hosts import Hosts
from deploy.supervision import manifest, processes
from deploy.supervision.environment import RANGE
from deploy.supervision.errors import DeploymentError
from interfaces.topics import DIAGNOSTICS
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
from tests import health_reports
from tests.health_reports import report

HERE = socket.gethostname()
heard = partial(health_reports.heard, Hosts)


def test_program_of_another_host_is_not_started_again() -> None:
    hosts = heard(report("/engine_controller", "robot1"))
    words = r"^engine_controller runs on host robot1 already, and a program runs on one host only: .*$"
    with pytest.raises(DeploymentError, match=words):
        hosts.check({})


def test_programs_of_other_hosts_and_other_arms_are_no_obstacle() -> None:
    heard(report("/sentinel_robot", "robot1"), report("/arm2/engine_controller", "robot2")).check({})
    heard(report("/engine_controller", "robot1"), namespace="/arm2").check({})


def test_orphan_of_this_host_is_replaced_and_a_stranger_is_not() -> None:
    hosts = heard(report("/velocity", HERE, pid=41))
    hosts.check({41: "velocity"})
    with pytest.raises(DeploymentError, match=r"^velocity runs on host"):
        hosts.check({41: "kinematics"})


@pytest.mark.parametrize(
    ("age", "words"), [(60.0, r"60\.0 s behind"), (-60.0, r"60\.0 s ahead of"), (0.08, "8. ms behind")]
)
def test_host_with_a_wrong_clock_is_refused(age: float, words: str) -> None:
    with pytest.raises(
        DeploymentError, match=f"^Clocks: the clock of host desk is {words} ours; synchronise both"
    ):
        heard(*3 * [report("/sentinel_operator", "desk", age=age)]).check({})


def test_least_age_of_a_report_shows_the_clock() -> None:
    hosts = heard(*(report("/sentinel_operator", "desk", age=age) for age in (0.3, 0.001, 0.2)))
    hosts.check({})
    assert hosts.clocks() in [
        f"Clocks: the clock of host desk is {ms} ms behind ours\n" for ms in range(1, 20)
    ]


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """This host is the robot of two hosts, and its process 7 is a dead man's switch."""
    monkeypatch.setenv(manifest.VARIABLE, "")
    environments = {7: {"SUPERVISOR_PROCESS_NAME": "dead_mans_switch"}}
    monkeypatch.setattr(processes, "environment_of", lambda pid: environments.get(pid, {}))
    with manifest.chosen("", host="robot"):
        yield


@pytest.mark.usefixtures("robot")
@pytest.mark.parametrize("program", ["dead_mans_switch", "sentinel_operator"])
def test_other_host_of_the_same_name_is_refused(program: str) -> None:
    words = f"^both hosts are named {HERE}: give each its own hostname \\(hostnamectl\\)$"
    with pytest.raises(DeploymentError, match=words):
        heard(report(f"/{program}", HERE, pid=8)).check({})


@pytest.mark.usefixtures("robot")
def test_both_parts_of_an_arm_may_run_on_one_host() -> None:
    heard(report("/dead_mans_switch", HERE, pid=7), report("/operator_page", "desk", pid=8)).check({})


def test_own_clock_is_not_shown() -> None:
    assert heard(report("/velocity", HERE)).clocks() == ""


def test_second_look_refuses_a_program_of_another_host() -> None:
    heard(report("/velocity", HERE, pid=41), report("/sentinel_robot", "robot1")).check_again()
    with pytest.raises(DeploymentError, match=r"^velocity runs on host robot1 already"):
        heard(report("/velocity", HERE, pid=41), report("/velocity", "robot1")).check_again()


def test_host_that_starts_during_the_start_is_heard_by_the_second_look(
    make_node: MakeNode, spin_until: SpinUntil, spin_for: SpinFor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(hosts, "LOOK", 0.0)
    monkeypatch.setenv(RANGE, "SUBNET")
    publisher = make_node().create_publisher(DIAGNOSTICS.type, DIAGNOSTICS.name, DIAGNOSTICS.qos)

    def spin_once() -> None:
        spin_until(lambda: publisher.get_subscription_count())
        publisher.publish(report("/velocity", "robot1"))
        spin_for(0.05)

    member = SimpleNamespace(node=make_node(), spin_once=spin_once)
    system = SimpleNamespace(members=list)
    refused = pytest.raises(DeploymentError, match=r"^velocity runs on host robot1 already")
    with hosts.checked(member, system) as look_again, refused:  # type: ignore[arg-type]
        look_again()
