from __future__ import annotations

import socket
import time
from types import SimpleNamespace
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import ClockType
from rclpy.parameter import Parameter
from rclpy.time import Time

from interfaces.service import ServiceNode
from interfaces.service.health import healths, heard_healths, reported_parameters
from interfaces.topics import DIAGNOSTICS
from reactive_node.testing import MakeNode, SpinUntil
from services import dead_mans_switch, operator_watchdog

GOOD = {"pid": "7", "published": "3", "seconds_since_output": "0.5"}


def message(name: str, values: dict[str, Any], host: str = "") -> DiagnosticArray:
    pairs = [KeyValue(key=key, value=value) for key, value in values.items()]
    status = DiagnosticStatus(name=name, message="running", hardware_id=host, values=pairs)
    return DiagnosticArray(status=[status])


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
        ("/arm1/battery", GOOD | {"seconds_since_output": "nan"}),
        ("/arm1/battery", GOOD | {"seconds_since_output": "inf"}),
        ("/arm1/battery", GOOD | {"seconds_since_output": "1e300"}),
        ("/arm1/battery", GOOD | {"seconds_since_turn_off": "-1"}),
        ("", {}),
    ],
)
def test_other_statuses_are_ignored(name: str, values: dict[str, Any]) -> None:
    assert healths(message(name, values), "/arm1") == {}


def test_report_tells_whether_the_service_is_ok_and_when_it_was_heard() -> None:
    report = message("/velocity", GOOD)
    report.status[0].level = DiagnosticStatus.WARN
    before = time.monotonic()

    health = healths(report, "")["velocity"]

    assert not health.ok
    assert before <= health.heard <= time.monotonic()


def test_report_without_pid_is_ignored_but_not_the_others() -> None:
    both = message("/arm1/battery", {"published": "3"})
    both.status += message("/arm1/velocity", GOOD).status

    assert healths(both, "/arm1").keys() == {"velocity"}


@pytest.mark.parametrize("namespace", ["", "/armX"])
def test_latest_report_of_each_service_of_each_host_is_kept(
    make_node: MakeNode, spin_until: SpinUntil, namespace: str
) -> None:
    publisher = make_node("peer").create_publisher(DIAGNOSTICS.type, DIAGNOSTICS.name, DIAGNOSTICS.qos)
    with heard_healths(make_node("listener", namespace=namespace)) as latest:
        spin_until(publisher.get_subscription_count)
        told = [("a", "velocity", 7), ("a", "kinematics", 8), ("b", "velocity", 7), ("a", "velocity", 9)]
        for host, name, pid in told:
            publisher.publish(message(f"{namespace}/{name}", GOOD | {"pid": str(pid)}, host))
        spin_until(lambda: ("a", "velocity") in latest and latest["a", "velocity"].pid == 9)

    pids = {process: health.pid for process, health in latest.items()}
    assert pids == {("a", "velocity"): 9, ("a", "kinematics"): 8, ("b", "velocity"): 7}
    spin_until(lambda: not publisher.get_subscription_count())


# Reporting


@pytest.fixture
def service(make_node: MakeNode) -> ServiceNode:
    service: ServiceNode = make_node("service", kind=ServiceNode)
    return service


def test_health_is_due_every_second_on_the_steady_clock(service: ServiceNode) -> None:
    (timer,) = [timer for timer in service.timers if not timer.is_canceled()]

    assert timer.timer_period_ns == 10**9
    assert timer.clock.clock_type == ClockType.STEADY_TIME


def test_warning_is_logged_when_it_is_new(service: ServiceNode, monkeypatch: pytest.MonkeyPatch) -> None:
    logged: list[str] = []
    logger = service.get_logger()
    monkeypatch.setattr(logger, "warning", logged.append)
    monkeypatch.setattr(service, "get_logger", lambda: logger)
    for reasons in (["late", "early"], ["late"], ["late", "lost"], [], ["late"]):
        for reason in reasons:
            service.remark("l1", reason)
        service.health.report()

    assert logged == ["l1: early; l1: late", "l1: late; l1: lost", "l1: late"]


def test_standing_warning_is_in_each_report(service: ServiceNode, monkeypatch: pytest.MonkeyPatch) -> None:
    published: list[Any] = []
    monkeypatch.setattr(service.health._publisher, "publish", published.append)
    service.health.standing = {"disk": "it is nearly full"}
    service.remark("l1", "late")
    for _ in range(2):
        service.health.report()
    service.health.standing = {}
    service.health.report()

    assert [each.status[0].message for each in published] == [
        "l1: late; disk: it is nearly full",
        "disk: it is nearly full",
        "running",
    ]


def test_report_has_host_uptime_and_age_of_the_last_output(
    service: ServiceNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    published: list[Any] = []
    monkeypatch.setattr(service.health._publisher, "publish", published.append)
    monkeypatch.setattr(service.health, "_started", 100.0)
    monkeypatch.setattr("interfaces.service.health.time.monotonic", lambda: 107.0)
    service.health.count_output()
    monkeypatch.setattr("interfaces.service.health.time.monotonic", lambda: 107.5)
    before = service.get_clock().now()
    service.health.report()

    (array,) = published
    (status,) = array.status
    values = {pair.key: pair.value for pair in status.values}
    assert (values["uptime"], values["seconds_since_output"], values["published"]) == ("7.500", "0.500", "1")
    assert (status.hardware_id, status.level) == (socket.gethostname(), DiagnosticStatus.OK)
    assert before <= Time.from_msg(array.header.stamp) <= service.get_clock().now()


def test_report_tells_the_parameters_that_are_not_the_default(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = [Parameter("silence", value=1.5), Parameter("strikes", value=3), Parameter("rate", value=50.0)]
    service = make_node("service", kind=ServiceNode, parameter_overrides=given)
    service.declare(operator_watchdog.Parameters)
    service.declare(dead_mans_switch.Parameters)
    published: list[Any] = []
    monkeypatch.setattr(service.health._publisher, "publish", published.append)
    service.health.report()

    (status,) = published[0].status
    assert reported_parameters(status) == {"silence": 1.5}  # `rate` may change


def test_report_is_sent_when_a_subscriber_comes_not_when_one_goes(
    service: ServiceNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    reports: list[int] = []
    for change in (1, 0, -1, 2):
        monkeypatch.setattr(service.health, "report", lambda change=change: reports.append(change))
        service.health._on_matched(SimpleNamespace(current_count_change=change))

    assert reports == [1, 2]


def test_subscriber_that_comes_as_the_node_ends_is_no_error(service: ServiceNode) -> None:
    service.destroy_node()
    service.health._on_matched(SimpleNamespace(current_count_change=1))
