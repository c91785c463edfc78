"""The clocks of other hosts, by the health reports of their services."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import pytest
import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from reactivex import Observable

from deploy.supervision import manifest
from interfaces.service import ServiceNode, clocks
from interfaces.service.clocks import MOST_HOSTS, MOST_REPORTS, Clocks
from interfaces.topics import DIAGNOSTICS, Topic
from reactive_node.testing import MakeNode, SpinUntil, VirtualTime
from services import drive, engine_controller, operator_watchdog
from tests import health_reports


def report(age: float, host: str = "desk", name: str = "/dead_mans_switch") -> DiagnosticArray:
    return health_reports.report(name, host, age=age)


heard = partial(health_reports.heard, Clocks)


def test_least_age_of_three_reports_shows_the_clock() -> None:
    assert heard(report(9.0), report(7.0)).differences() == {}
    assert heard(report(9.0), report(7.0), report(8.0)).differences() == {"desk": pytest.approx(7.0, abs=0.5)}


@pytest.mark.parametrize("namespace", ["/arm1", "/X/"])
def test_hosts_of_an_arm_in_a_namespace_are_known(namespace: str) -> None:
    name = f"{namespace.rstrip('/')}/velocity"
    assert heard(*(report(9.0, name=name) for _ in range(3)), namespace=namespace).differences()


@pytest.mark.parametrize("others", [{"host": socket.gethostname()}, {"host": ""}, {"name": "/arm2/velocity"}])
def test_this_host_and_those_of_other_arms_are_no_other_hosts(others: dict[str, str]) -> None:
    assert heard(*(report(9.0, **others) for _ in range(3))).differences() == {}


def test_host_that_has_not_reported_for_three_seconds_has_no_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    found = heard(*(report(9.0) for _ in range(3)))
    now = clocks.time.monotonic()
    monkeypatch.setattr(clocks.time, "monotonic", lambda: now + 2.9)
    assert found.differences()
    monkeypatch.setattr(clocks.time, "monotonic", lambda: now + 3.1)
    assert found.differences() == {}


def test_hosts_that_have_gone_make_room_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    found = heard(*(report(0.0, f"host{number}") for number in range(MOST_HOSTS) for _ in range(3)))
    assert len(found.differences()) == MOST_HOSTS
    now = clocks.time.monotonic()
    monkeypatch.setattr(clocks.time, "monotonic", lambda: now + 3.1)
    assert found.differences() == {}
    for _ in range(3):
        found.hear(report(9.0))
    assert found.wrong().keys() == {"desk"}


def test_only_the_first_hosts_and_the_last_reports_count() -> None:
    hosts = [f"host{number}" for number in range(MOST_HOSTS + 1)]
    assert heard(*(report(9.0, host) for host in hosts for _ in range(3))).wrong().keys() == {*hosts[:-1]}
    found = heard(report(0.0), *(report(9.0) for _ in range(MOST_REPORTS)))
    assert found.differences() == {"desk": pytest.approx(9.0, abs=0.5)}


def test_nothing_is_refused_where_no_host_is_awaited() -> None:
    assert heard().refusal() == ""


@pytest.mark.parametrize(
    ("age", "words"),
    [
        (9.0, "the clock of host desk is more than 50 ms behind ours"),
        (-9.0, "the clock of host desk is more than 50 ms ahead of ours"),
        (0.0, ""),
    ],
)
def test_clock_that_differs_by_more_than_the_tolerance_is_a_problem(age: float, words: str) -> None:
    assert heard(*(report(age) for _ in range(3))).problem() == words


@pytest.mark.parametrize(
    ("behind", "words"), [(0.9, "900 ms behind"), (0.0, "0 ms ahead of"), (-1.0, "1.0 s ahead of")]
)
def test_difference_is_given_in_words(behind: float, words: str) -> None:
    assert clocks.difference("desk", behind) == f"the clock of host desk is {words} ours"


def test_reported_clock_is_one_of_the_arm_and_a_number() -> None:
    def report(value: str) -> DiagnosticArray:
        values = [KeyValue(key="clock of host desk", value=value)]
        status = DiagnosticStatus(name="/arm1/engine_controller", hardware_id="robot1", values=values)
        return DiagnosticArray(status=[status])

    assert clocks.reported(report("0.5"), "/arm1") == {"desk": (0.5, "robot1")}
    assert clocks.reported(report("?"), "/arm1") == {}


@pytest.mark.parametrize(("age", "problem"), [(9.0, "clocks: the clock of host desk is"), (0.0, "")])
def test_service_reports_the_clocks(
    make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch, age: float, problem: str
) -> None:
    monkeypatch.setenv(manifest.HOST, "robot")
    node: ServiceNode = make_node("service", kind=ServiceNode)
    refusals: list[str] = []
    clocks.observe(node).subscribe(refusals.append, scheduler=node.scheduler)
    published: list[Any] = []
    publisher = make_node("desk").create_publisher(DIAGNOSTICS.type, DIAGNOSTICS.name, DIAGNOSTICS.qos)

    def is_known() -> bool:
        publisher.publish(report(age))
        return "clock of host desk" in "".join(node.health.facts)

    spin_until(is_known)
    waiting = "the clocks of the hosts are not compared yet"
    spin_until(
        lambda: refusals == [waiting, "the clock of host desk is more than 50 ms behind ours" if age else ""]
    )
    monkeypatch.setattr(node.health.publisher, "publish", published.append)
    node.health.report()
    assert published[0].status[0].message.startswith(problem or "running")
    assert "clock of host desk" in [pair.key for pair in published[0].status[0].values]
    assert clocks.reported(published[0], "") == {"desk": (pytest.approx(age, abs=1.0), socket.gethostname())}
    assert clocks.reported(published[0], "/arm2") == {}


def test_service_of_a_single_host_hears_no_reports(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(manifest.HOST, raising=False)
    node: ServiceNode = make_node("service", kind=ServiceNode)
    refusals: list[str] = []
    clocks.observe(node).subscribe(refusals.append, scheduler=node.scheduler)
    assert DIAGNOSTICS.name not in [each.topic_name for each in node.subscriptions]
    assert refusals == []


def test_engines_wait_for_the_first_comparison_of_the_clocks(
    make_node: MakeNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = time.monotonic()
    monkeypatch.setenv(manifest.HOST, "robot")
    node: ServiceNode = make_node("service", kind=ServiceNode)
    refusals: list[str] = []
    clocks.observe(node).subscribe(refusals.append, scheduler=node.scheduler)
    assert refusals == ["the clocks of the hosts are not compared yet"]
    spin_until(lambda: refusals[1:] == [""])  # no other host runs
    assert time.monotonic() - begin >= 3.0


class Lonely:
    """A node of a host that hears no other one."""

    def get_namespace(self) -> str:
        return "/"

    def observe(self, topic: Topic) -> Observable[Any]:
        return rx.never()


def test_wait_for_a_host_that_does_not_run_is_three_seconds_long(
    scheduler: VirtualTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(manifest.HOST, "robot")
    monkeypatch.setattr(clocks.time, "monotonic", lambda: scheduler.clock)
    node: Any = Lonely()
    (begin, first), (end, second) = scheduler.record(clocks.observe(node), until=5.0).items
    assert (first, second) == ("the clocks of the hosts are not compared yet", "")
    assert (begin, end) == (0.0, pytest.approx(3.0, abs=0.11))


@pytest.mark.parametrize(
    ("age", "words"), [(0.0, ""), (9.0, "the clock of host desk is more than 50 ms behind ours")]
)
def test_first_comparison_ends_the_wait(age: float, words: str) -> None:
    found = Clocks("/")
    found.awaited_until = math.inf
    for _ in range(3):
        assert found.refusal() == "the clocks of the hosts are not compared yet"
        found.hear(report(age))
    assert found.refusal() == words


@pytest.mark.parametrize(
    "wire", [operator_watchdog.wire, engine_controller.wire, drive.wire], ids=["F1", "F2", "F3"]
)
def test_no_fail_safe_reads_reports_of_health(
    make_node: MakeNode, wire: Callable[[ServiceNode], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(manifest.HOST, raising=False)
    node = make_node("service", kind=ServiceNode)
    wire(node)
    assert DIAGNOSTICS.name not in {each.topic_name for each in node.subscriptions}
