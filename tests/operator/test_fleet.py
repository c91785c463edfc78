"""The lines of the fleet: one for each arm."""

from __future__ import annotations

import socket
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from reactivex import Observable
from reactivex.testing import ReactiveTest, TestScheduler

from deploy.operator.fleet import Arm, Timestamp, fleet, row, watched
from deploy.supervision import sentinel
from deploy.supervision.supervisord import Program
from interfaces.service.health import Health
from interfaces.topics import ALIVE, DIAGNOSTICS, ENGINES_STATE, MISSED, OFF, ON, OPERATOR_ACTIVITY, Topic

Script = list[tuple[float, Topic, Any]]
"""When a message arrives [s], on which topic, and its value."""


def health(program: str, *, ok: bool = True, host: str = "robot1", **values: str) -> DiagnosticArray:
    given = {"pid": "7", "published": "1", **values}
    status = DiagnosticStatus(
        name=program,
        level=DiagnosticStatus.OK if ok else DiagnosticStatus.WARN,
        message="running" if ok else "too old",
        hardware_id=host,
        values=[KeyValue(key=key, value=value) for key, value in given.items()],
    )
    return DiagnosticArray(status=[status])


def arms(scripts: dict[str, Script]) -> list[tuple[float, Arm]]:
    """Return the arms of a fleet after each of their messages."""
    scheduler = TestScheduler()

    def of(name: str) -> Observable[Arm]:
        def seen(topic: Topic) -> Observable[Any]:
            items = [ReactiveTest.on_next(at, value) for at, on, value in scripts[name] if on is topic]
            return scheduler.create_hot_observable(items)

        return watched(Arm(name, 0), seen, lambda: scheduler.clock)

    results = scheduler.start(
        lambda: fleet(of(name) for name in scripts), created=0.01, subscribed=0.02, disposed=60.0
    )
    return [(message.time, message.value.value) for message in results.messages]


def last(script: Script, name: str = "/arm1") -> Arm:
    return arms({name: script})[-1][1]


def test_each_message_of_each_arm_is_its_news() -> None:
    news = arms(
        {
            "/arm1": [(1.0, ENGINES_STATE, OFF), (3.0, OPERATOR_ACTIVITY, ALIVE)],
            "/arm2": [(2.0, ENGINES_STATE, ON)],
        }
    )
    assert [(at, arm.name, arm.engines.value, arm.operator.value) for at, arm in news] == [
        (1.0, "/arm1", OFF, ""),
        (2.0, "/arm2", ON, ""),
        (3.0, "/arm1", OFF, ALIVE),
    ]


def test_arm_that_is_well_is_one_line() -> None:
    script: Script = [
        (1.0, ENGINES_STATE, ON),
        (1.0, OPERATOR_ACTIVITY, ALIVE),
        (1.1, DIAGNOSTICS, health("/arm1/velocity")),
        (1.2, DIAGNOSTICS, health("/arm1/engine_controller")),
        (1.3, DIAGNOSTICS, health("/arm2/velocity", ok=False)),
    ]
    arm = last(script)
    heard = max(health.heard for health in arm.healths.values())
    fresh = arm._replace(engines=Timestamp(ON, heard), operator=Timestamp(ALIVE, heard))
    assert row(fresh, heard) == ("/arm1", "0", "robot1", ALIVE, ON, "2 ok", "10.5 s")


def test_bound_follows_from_the_presence_timeout_of_the_arm() -> None:
    report = health("/arm1/engine_controller", **{"parameter presence_timeout": "4.5"})
    arm = last([(1.0, DIAGNOSTICS, report)])
    assert row(arm, 0.0)[-1] == "5 s"


UNUSABLE = ["soon", 100_000 * "[", '"soon"', "[1.0]", "NaN", "1e400", "1" + 400 * "0"]


@pytest.mark.parametrize("value", UNUSABLE, ids=lambda value: value[:9])
def test_bound_of_an_unusable_parameter_is_unknown(value: str) -> None:
    report = health("/arm1/engine_controller", **{"parameter presence_timeout": value})
    arm = last([(1.0, DIAGNOSTICS, report)])
    assert row(arm, arm.healths["robot1", "engine_controller"].heard)[5:] == ("1 ok", "-")


@pytest.mark.parametrize(("sampling", "silence"), [("0.5", "0.1"), ('"b"', '"a"')])
def test_bound_of_parameters_that_contradict_each_other_is_unknown(sampling: str, silence: str) -> None:
    given = {"parameter sampling": sampling, "parameter silence": silence}
    arm = last([(1.0, DIAGNOSTICS, health("/arm1/operator_watchdog", **given))])
    assert row(arm, 0.0)[-1] == "-"


def well(heard: float, host: str = "robot1", **problems: str) -> Arm:
    """Return an arm of three programs on one host, some of which report a problem."""
    reports = {
        (host, name): Health(heard, 7, name not in problems, problems.get(name, "running"), None, host)
        for name in ("drive", "kinematics", "velocity")
    }
    return Arm("/", 0, Timestamp(ON, heard), Timestamp(ALIVE, heard), reports)


@pytest.mark.parametrize(
    ("problems", "words"),
    [
        ({}, "3 ok"),
        ({"kinematics": "l1: -1 is negative"}, "kinematics: l1: -1 is negative"),
        ({"velocity": "slow", "drive": "full"}, "drive: full (and 1 more)"),
    ],
)
def test_first_problem_of_an_arm_is_shown(problems: dict[str, str], words: str) -> None:
    assert row(well(10.0, **problems), 11.0)[5] == words


def test_process_that_does_not_run_is_a_problem() -> None:
    program = Program("drive", "FATAL", 0, 0.0, 3, "exit code 1", "")
    states = DiagnosticArray(status=sentinel.states([program], {}, {}, "/arm1/sentinel"))
    here = socket.gethostname()
    arm = last([(1.0, DIAGNOSTICS, health("/arm1/velocity", host=here)), (1.1, DIAGNOSTICS, states)])
    assert row(arm, arm.healths[here, "velocity"].heard)[5] == "drive: FATAL"


@pytest.mark.parametrize(
    ("problems", "words"), [({}, "3 ok, 1 unheard"), ({"drive": "slow"}, "drive: slow, 1 unheard")]
)
def test_programs_that_run_unheard_are_counted(problems: dict[str, str], words: str) -> None:
    states = {("robot1", "drive"): "RUNNING", ("robot1", "twist"): "RUNNING", ("robot2", "page"): "RUNNING"}
    assert row(well(10.0, **problems)._replace(states=states), 11.0)[5] == words


@pytest.mark.parametrize("ok", [(True, True), (False, True), (True, False)])
def test_program_on_two_hosts_counts_twice_and_a_problem_of_either_is_shown(ok: tuple[bool, bool]) -> None:
    reports = [health("/arm1/drive", ok=good, host=host) for good, host in zip(ok, "ab", strict=True)]
    arm = last([(at, DIAGNOSTICS, report) for at, report in enumerate(reports, start=1)])
    shown = row(arm, arm.healths["b", "drive"].heard)
    assert (shown[2], shown[5]) == ("a, b", "2 ok" if all(ok) else "drive: too old")


def test_state_of_a_process_on_one_host_hides_no_other() -> None:
    arm = last(
        [
            (1.0, DIAGNOSTICS, health("/arm1/drive", host="a")),
            (1.1, DIAGNOSTICS, health("/arm1/drive", host="b")),
            (1.2, DIAGNOSTICS, told_by("a", "FATAL")),
            (1.3, DIAGNOSTICS, told_by("b", "RUNNING")),
        ]
    )
    assert row(arm, arm.healths["b", "drive"].heard)[5] == "drive: FATAL"


def told_by(host: str, state: str) -> DiagnosticArray:
    """Return the state of a process as the sentinel of a host reports it."""
    (status,) = sentinel.states([Program("drive", state, 7, 0.0, 0, "", "")], {}, {}, "/arm1/sentinel")
    status.hardware_id = host
    return DiagnosticArray(status=[status])


def test_host_that_another_one_has_replaced_is_forgotten() -> None:
    states = {("old", "drive"): "STOPPING", ("new", "drive"): "RUNNING"}
    healths = {**well(1.0, host="old").healths, **well(10.0, host="new").healths}
    shown = row(Arm("/", 0, healths=healths, states=states), 11.0)
    assert (shown[2], shown[5]) == ("new", "3 ok")


@pytest.mark.parametrize(("operator", "shown"), [(ALIVE, "-"), (MISSED, MISSED)])
def test_arm_that_falls_silent_shows_nothing_as_fresh(operator: str, shown: str) -> None:
    arm = well(10.0)._replace(operator=Timestamp(operator, 10.0))
    assert row(arm, 12.8)[3:6] == (shown, "silent", "silent")


def test_service_that_falls_silent_is_a_problem() -> None:
    arm = well(10.0)
    drive = "robot1", "drive"
    old = arm.healths[drive]._replace(heard=8.0)
    assert row(arm._replace(healths={**arm.healths, drive: old}), 11.0)[5] == "drive: silent"


def test_host_that_falls_silent_is_still_named() -> None:
    arm = well(10.0)
    switch = Health(2.0, 7, True, "running", None, "desk")
    arm = arm._replace(healths={**arm.healths, ("desk", "dead_mans_switch"): switch})
    assert row(arm, 11.0)[2::3] == ("desk, robot1", "dead_mans_switch: silent")


def test_arm_that_was_never_heard_is_silent() -> None:
    assert row(Arm("/arm3", 5), 100.0) == ("/arm3", "5", "-", "-", "silent", "silent", "-")
