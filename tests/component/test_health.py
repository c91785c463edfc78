from __future__ import annotations

import os
import socket
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from rclpy.time import Time

from interfaces.arm_variables import SYSTEM
from interfaces.limits import LARGEST_MESSAGE, bad_report
from interfaces.reactive_node.tests.leftovers import assert_nothing_is_left
from interfaces.service import ServiceNode
from interfaces.service.beats import Beats
from interfaces.service.health import (
    cause,
    healths,
    heard_healths,
    reported_movement,
    reported_parameters,
    reported_refusals,
)
from interfaces.topics import DIAGNOSTICS, ROWS
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
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
    older = healths(message("/velocity", {"pid": "7", "published": "3"}), "")["velocity"]
    assert older.since_output is None


def test_name_of_a_host_has_64_characters_at_most() -> None:
    health = healths(message("/velocity", GOOD, "h" * 65), "")["velocity"]
    assert health.host == "h" * 64


def test_movement_of_a_service_is_read_from_its_report() -> None:
    (status,) = message("/config_theta1", GOOD | {"fastest": "0.5", "by hand": "value"}).status
    assert reported_movement(status) == {"fastest": 0.5, "by hand": "value"}


def test_nested_parameter_is_an_error_of_the_report() -> None:
    (status,) = message("/velocity", GOOD | {"parameter rate": "[" * 1_000_000}).status
    with pytest.raises(ValueError, match=r"^a parameter is nested too deeply$"):
        reported_parameters(status)


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
        ("/arm1/battery", GOOD | {"seconds_since_output": "-1"}),
        ("", {}),
    ],
)
def test_other_statuses_are_ignored(name: str, values: dict[str, Any]) -> None:
    assert healths(message(name, values), "/arm1") == {}


def test_report_says_whether_the_service_is_ok_and_when_it_was_heard() -> None:
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
        senders = [("a", "velocity", 7), ("a", "kinematics", 8), ("b", "velocity", 7), ("a", "velocity", 9)]
        for host, name, pid in senders:
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


@pytest.fixture
def logged(service: ServiceNode, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The warnings of the service."""
    warnings: list[str] = []
    logger = service.get_logger()
    monkeypatch.setattr(logger, "warning", warnings.append)
    monkeypatch.setattr(service, "get_logger", lambda: logger)
    return warnings


@pytest.fixture
def published(service: ServiceNode, monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """The reports of the service."""
    reports: list[Any] = []
    monkeypatch.setattr(service.health.publisher, "publish", reports.append)
    return reports


def test_health_is_due_every_second_on_the_steady_clock(service: ServiceNode) -> None:
    (timer,) = [timer for timer in service.timers if not timer.is_canceled()]

    assert timer.timer_period_ns == 10**9
    assert timer.clock.clock_type == ClockType.STEADY_TIME


def test_each_second_shows_a_sign_of_life(
    service: ServiceNode, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(SYSTEM, str(tmp_path))
    reader = Beats(tmp_path)
    spin_until(lambda: os.getpid() in reader.take())


def test_sign_of_life_waits_for_nothing_that_may_wait_for_dds(
    service: ServiceNode, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv(SYSTEM, str(tmp_path))
    reader = Beats(tmp_path)
    has_beaten: list[bool] = []
    # The first question to DDS: who else is on the topics.
    monkeypatch.setattr(
        service.peers, "problems", lambda: iter(has_beaten.append(os.getpid() in reader.take()) or ())
    )

    service.health.on_period()

    assert has_beaten == [True]


def test_report_carries_the_time_of_day_in_simulated_time(make_node: MakeNode, spin_until: SpinUntil) -> None:
    heard: list[DiagnosticArray] = []
    make_node("peer").create_subscription(DIAGNOSTICS.type, DIAGNOSTICS.name, heard.append, DIAGNOSTICS.qos)
    make_node("simulated", kind=ServiceNode, parameter_overrides=[Parameter("use_sim_time", value=True)])
    spin_until(lambda: heard)
    assert abs(time.time_ns() - Time.from_msg(heard[-1].header.stamp).nanoseconds) < 10e9


def test_warning_is_logged_when_it_is_new(service: ServiceNode, logged: list[str]) -> None:
    for reasons in (["late", "early"], ["late"], ["late", "lost"], [], ["late"]):
        for reason in reasons:
            service.remark("l1", reason)
        service.health.report()

    assert logged == ["l1: early; l1: late", "l1: late; l1: lost", "l1: late"]


def test_cause_with_other_numbers_is_no_new_cause(
    service: ServiceNode, logged: list[str], published: list[Any]
) -> None:
    for second in range(3):
        for age in range(10):
            service.health.drop("theta1", f"it is {second}.{age}00 s old")
        service.health.drop("theta1", f"-{second}e-05 is not finite")
        service.health.standing = {"disk": f"{second} MB are left"}
        service.health.report()
    service.health.drop("theta1", "nan is not finite")
    service.health.report()

    assert logged == ["disk: 0 MB are left; theta1: -0e-05 is not finite; theta1: it is 0.000 s old"]
    assert [each.status[0].message for each in published[1:3]] == [
        f"theta1: it is {second}.000 s old (10 times); theta1: -{second}e-05 is not finite; "
        f"disk: {second} MB are left"
        for second in (1, 2)
    ]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("l1 publishes it", "l2 publishes it"),
        ("/ur/2 publishes it", "/ur/3 publishes it"),
        ("the clock of host arm-2 is late", "the clock of host arm-3 is late"),
        ("cannot deserialize 8 bytes as a/msg/Float32", "cannot deserialize 8 bytes as a/msg/Float64"),
    ],
)
def test_number_in_a_name_distinguishes_causes(one: str, other: str) -> None:
    assert cause(one) != cause(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("[nan, 0.0, 1e-05] is not finite", "[-1.5, inf, 2] is not finite"),
        ("(1.0, -nan)", "(1e300, 7)"),
        ("8 octets", "12 octets"),
        ("the motor has 81.5C", "the motor has 9C"),
        ("it is 0.301 s old", "it is 12.000 s old"),
        ("status 0x7f3a", "status 0xC0"),
        ("NaN of 1E-05", "-Inf of 2.5E+10"),
    ],
)
def test_number_that_is_measured_is_no_part_of_a_cause(one: str, other: str) -> None:
    assert cause(one) == cause(other)


def test_long_cause_with_other_numbers_is_no_new_cause(service: ServiceNode, logged: list[str]) -> None:
    for number in (7, 1234.5):
        service.remark("drive", f"its motors have {[number] * 20} C, " + 30 * "and so on ")
        service.health.report()

    assert len(logged) == 1


def test_report_is_never_too_large_to_be_read(service: ServiceNode, published: list[Any]) -> None:
    for number in range(1000):
        for subject in ("l1", "l2", "theta1", "theta2"):
            service.health.refuse(subject, f"{number}\ufffd" * 10_000, -(2**63) + number, -(2**63))
        for topic in ROWS:
            service.health.drop(topic.name, f"{number}\ufffd" * 10_000)
    service.health.report()
    assert len(serialize_message(published[0])) <= LARGEST_MESSAGE
    assert bad_report(published[0]) == ""


def test_long_reasons_are_cut(service: ServiceNode, published: list[Any]) -> None:
    service.remark("l1", "x" * 201)
    service.health.report()
    for topic in range(30):
        service.remark(f"topic{topic}", "x" * 201)
    service.health.report()
    one, many = (each.status[0].message for each in published)
    assert one == f"l1: {'x' * 200}"
    assert len(many) == 4000


def test_causes_that_look_the_same_are_one_reason(service: ServiceNode, published: list[Any]) -> None:
    numbers = "1.23456 " * 30
    for end in ("degrees", "volts"):
        service.remark("drive", numbers + end)
    service.health.report()
    assert published[0].status[0].message == f"drive: {numbers[:200]} (2 times)"


def test_refused_samples_are_counted_and_the_first_50_listed(
    service: ServiceNode, published: list[Any]
) -> None:
    for moment in range(51):
        service.health.refuse("l1", "it is late", moment, None)
    service.health.refuse("l2", "it is early", 7, 9)
    service.health.report()
    (status,) = published[0].status
    assert status.message == "l1: it is late (51 times); l2: it is early"
    assert service.health.dropped == 51
    assert reported_refusals(status, "l1") == [(moment, None) for moment in range(50)]
    assert reported_refusals(status, "l2") == [(7, 9)]


def test_what_is_usual_is_counted_since_the_start(service: ServiceNode, published: list[Any]) -> None:
    for _ in range(3):
        service.health.count("late heartbeats")
        service.health.report()
    counts = [pair.value for each in published for pair in each.status[0].values if "late" in pair.key]
    assert counts == ["1", "2", "3"]


def test_standing_warning_is_in_each_report(service: ServiceNode, published: list[Any]) -> None:
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


def test_report_has_facts_while_items_are_observed(service: ServiceNode, published: list[Any]) -> None:
    stated = service.stating({"fastest": "0.5"}, rx.never())
    service.health.report()
    observed = stated.subscribe()
    service.health.report()
    observed.dispose()
    service.health.report()
    values = [{pair.key: pair.value for pair in array.status[0].values} for array in published]
    assert [each.get("fastest") for each in values] == [None, "0.5", None]


def test_report_has_host_uptime_and_age_of_the_last_output(
    service: ServiceNode, published: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
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
    assert (status.name, values["pid"]) == ("/service", str(os.getpid()))
    assert (status.hardware_id, status.level) == (socket.gethostname(), DiagnosticStatus.OK)
    assert before <= Time.from_msg(array.header.stamp) <= service.get_clock().now()


def test_report_has_the_parameters_that_are_not_the_default(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    given = [Parameter("silence", value=1.5), Parameter("strikes", value=3), Parameter("rate", value=50.0)]
    service = make_node("service", kind=ServiceNode, parameter_overrides=given)
    service.declare(operator_watchdog.Parameters)
    service.declare(dead_mans_switch.Parameters)
    published: list[Any] = []
    monkeypatch.setattr(service.health.publisher, "publish", published.append)
    service.health.report()

    (status,) = published[0].status
    assert [pair.value for pair in status.values if pair.key == "parameter silence"] == ["1.5"]
    assert reported_parameters(status) == {"silence": 1.5}  # `rate` may change


def test_report_is_sent_when_a_subscriber_comes_not_when_one_goes(
    service: ServiceNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    reports: list[int] = []
    for change in (1, 0, -1, 2):
        monkeypatch.setattr(service.health, "report", lambda change=change: reports.append(change))
        service.health.on_matched(SimpleNamespace(current_count_change=change))

    assert reports == [1, 2]


def test_new_subscriber_hears_what_the_last_look_found(
    service: ServiceNode, published: list[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = iter([["a loop"], []])
    health = service.health
    monkeypatch.setattr(service.peers, "problems", lambda: (("cmd_vel_in", reason) for reason in next(found)))
    health.on_period()
    health.on_matched(SimpleNamespace(current_count_change=1))
    health.on_matched(SimpleNamespace(current_count_change=1))
    health.on_period()
    health.on_matched(SimpleNamespace(current_count_change=1))
    messages = [array.status[0].message for array in published]
    assert messages == [*3 * ["cmd_vel_in: a loop"], "running", "running"]


def test_subscriber_that_comes_as_the_node_ends_is_no_error(service: ServiceNode) -> None:
    service.destroy_node()
    service.health.on_matched(SimpleNamespace(current_count_change=1))


@pytest.mark.timeout(120)
def test_nothing_is_left_of_reports(
    make_node: MakeNode, spin_until: SpinUntil, spin_for: SpinFor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("interfaces.service.health.PERIOD", 3600.0)
    service, peer = make_node("service", kind=ServiceNode), make_node("peer", kind=Node)
    heard: list[Any] = []
    peer.create_subscription(DIAGNOSTICS.type, DIAGNOSTICS.name, heard.append, DIAGNOSTICS.qos)
    spin_until(lambda: heard)  # the report to a new subscriber

    def report() -> None:
        heard.clear()
        service.health.drop("subject", "a reason with 1.5")
        service.health.on_period()
        spin_until(lambda: heard)

    assert_nothing_is_left(report, lambda: spin_for(0.1))
