"""The lines of the operator's terminal, in virtual time: a tick is a second."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from datetime import UTC, datetime, timedelta
from itertools import pairwise
from typing import Any

import pytest
import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from reactivex import Observable
from reactivex.testing import ReactiveTest, TestScheduler

from deploy.operator.lines import Allowance, Kind, Line, line_batches, unrepeated
from deploy.supervision import sentinel
from deploy.supervision.supervisord import Program
from interfaces import cause, topics
from interfaces.cause import STARTED, Cause
from interfaces.topics import Position
from reactive_node.stamps import Timestamp

Message = tuple[float, topics.Topic, Any]
"""When it arrives [s], on which topic, and the message."""
Play = Callable[..., list[Line]]

ORIGIN = datetime(1970, 1, 1, tzinfo=UTC)
PERIOD = 0.1  # s between two batches
AGE = 0.02  # s of a message that arrives late


@pytest.fixture
def play(scheduler: TestScheduler) -> Play:
    """Return the lines shown until 60 s.

    `late` was sent `AGE` before it arrives.
    """

    def play(script: Iterable[Message], *, late: Any = None) -> list[Line]:
        def sent(message: Any) -> Timestamp[Any]:
            return Timestamp(message, scheduler.now - timedelta(seconds=AGE if message is late else 0))

        def seen(topic: topics.Topic) -> Observable[Any]:
            arrivals = [ReactiveTest.on_next(at, message) for at, on, message in script if on is topic]
            return scheduler.create_hot_observable(arrivals).map(sent)

        def batches() -> Observable[list[Line]]:
            return line_batches(seen, rx.interval(PERIOD))

        # RxPY takes 0 for none.
        shown = scheduler.start(batches, created=1e-9, subscribed=1e-9, disposed=60.0)
        assert all(batch.value.value for batch in shown.messages)
        return [line for batch in shown.messages for line in batch.value.value]

    return play


def activity(conclusion: str, *times: float) -> list[Message]:
    return [(time, topics.OPERATOR_ACTIVITY, conclusion) for time in times]


def commands(command: str, *times: float) -> list[Message]:
    return [(time, topics.ENGINES, command) for time in times]


def values(*changes: tuple[float, topics.Topic, float]) -> list[Message]:
    return [(time, topic, value) for time, topic, value in changes]


def texts(lines: Iterable[Line]) -> list[str]:
    return [line.text for line in lines]


def times(lines: Iterable[Line]) -> list[float]:
    return [round((line.time - ORIGIN).total_seconds(), 3) for line in lines]


def test_data_appear_when_all_four_values_are_known_and_at_each_change(play: Play) -> None:
    script = values((1, topics.L1, 2), (1, topics.L2, 3), (1, topics.THETA1, 0.785398))
    script += values((2, topics.THETA2, 0.5), (3, topics.THETA2, 1.785398))
    assert texts(play(script)) == [
        "### Received new data: {2, 3, 0.785398, 0.5}",
        "### Received new data: {2, 3, 0.785398, 1.7854}",
    ]


DRIVEN = [(0.5, topics.DRIVEN_TIME, 0.0)]


@pytest.mark.parametrize(("drive", "shown"), [(DRIVEN, [1, 2, 4]), ([], [1, 2, 3, 4])])
def test_values_of_an_arm_with_a_drive_are_shown_when_they_change(
    play: Play, drive: list[Message], shown: list[float]
) -> None:
    script = values((1, topics.L1, 2), (1, topics.L2, 3), (1, topics.THETA1, 0), (1, topics.THETA2, 0))
    changes = values((2, topics.THETA1, 1), (3, topics.THETA1, 1), (4, topics.THETA1, 0))
    assert times(play(drive + script + changes)) == shown


@pytest.mark.parametrize(("drive", "shown"), [(DRIVEN, [0.2, 3]), ([], [0.2, 2, 3])])
def test_positions_of_an_arm_with_a_drive_are_shown_when_they_change(
    play: Play, drive: list[Message], shown: list[float]
) -> None:
    places = {0.2: (2.0, 3.0), 0.4: (2.0, 3.0), 2: (2.0, 3.0), 3: (2.0, 3.5)}
    positions = [(at, Position(int(at * 1e9), *place)) for at, place in places.items()]
    assert times(play(drive + [(at, topics.EFFECTOR_POSITION, it) for at, it in positions])) == shown


def test_value_that_comes_before_a_drive_is_known_is_shown() -> None:
    found: list[Any] = []
    unrepeated(rx.of(Timestamp(1.0, ORIGIN)), rx.never(), float).subscribe(found.append)
    assert [each.value for each in found] == [1.0]


def test_lines_of_a_batch_are_in_the_order_of_their_source_times(play: Play) -> None:
    sent_first = Position(0, -3.4029603, 3.1472500)
    script = [
        (1.01, topics.EFFECTOR_SPEED, 3.318452),
        (1.02, topics.EFFECTOR_POSITION, sent_first),
    ]
    assert texts(play(script, late=sent_first)) == [
        "Position x: -3.40296 and y: 3.14725",
        "Speed: 3.31845 [m/s]",
    ]


def test_each_heartbeat_of_a_pressed_switch_is_shown(play: Play) -> None:
    script = [(at, topics.OPERATOR_HEARTBEAT, pressed) for at, pressed in ((1, True), (2, False), (3, True))]
    assert texts(play(script)) == ["### Received signal from operator"] * 2


MISSED = "Not received signal from operator..."
ASLEEP = ["Operator is sleeping !!!", "Turning off engines..."]


def test_conclusions_of_the_watchdog_are_shown_with_their_times(play: Play) -> None:
    script = activity(topics.ALIVE, 1.5, 4.5) + activity(topics.MISSED, 7.5, 10.5, 13.5)
    shown = play(script + activity(topics.INCAPACITATED, 13.5))
    assert texts(shown) == ["Operator is alive"] * 2 + [MISSED] * 3 + ASLEEP
    assert times(shown) == [1.5, 4.5, 7.5, 10.5, 13.5, 13.5, 13.5]


def test_repeated_commands_of_the_watchdog_are_hidden(play: Play) -> None:
    script = activity(topics.ALIVE, 4.5) + activity(topics.INCAPACITATED, 13.5)
    shown = play(script + turn_offs("operator_watchdog", *(13.5 + 0.5 * n for n in range(20))))
    assert texts(shown[1:]) == ASLEEP


def test_operator_who_returned_can_fall_asleep_again(play: Play) -> None:
    script = activity(topics.INCAPACITATED, 10, 30) + activity(topics.ALIVE, 1, 20)
    shown = play(script + turn_offs("operator_watchdog", 10, 10.5, 30, 30.5))
    assert texts(shown)[1:] == [*ASLEEP, "Operator is alive", *ASLEEP]


def test_every_sleep_of_an_operator_is_shown(play: Play) -> None:
    assert texts(play(activity(topics.INCAPACITATED, *range(10, 50, 5)))) == ASLEEP * 8


def turn_offs(node: str, *times: float) -> list[Message]:
    sender = topics.Sender(topics.TURN_OFF, node)
    return [*commands(topics.TURN_OFF, *times), *((time, topics.ENGINES_SENDER, sender) for time in times)]


def test_turn_off_is_attributed_to_the_node_that_sent_it(play: Play) -> None:
    script = activity(topics.ALIVE, 1, 1.5, 2) + commands(topics.TURN_ON, 1.2)
    assert texts(play(script + turn_offs("terminal_7", 1.7))) == [
        "Operator is alive",
        "Turning on engines...",
        "Operator is alive",
        "Turning off engines, as terminal_7 asked...",
        "Operator is alive",
    ]


def test_watchdog_that_commands_since_before_is_named_once(play: Play) -> None:
    shown = play(turn_offs("operator_watchdog", 1, 1.5, 2))
    assert texts(shown) == ["Turning off engines, as operator_watchdog asked..."]


def causes(*given: tuple[float, Cause]) -> list[Message]:
    return [(time, topics.ENGINES_CAUSE, cause.message(each)) for time, each in given]


def test_engines_are_shown_when_they_change_with_the_cause(play: Play) -> None:
    given = [
        (1.0, Cause("off", STARTED)),
        (2.1, Cause("on", "turn_on", "terminal_7", since=0.1)),
        (3.1, Cause("off", "turn_off", "operator_page", since=0.05)),
        (4.0, Cause("off", "turn_off", "operator_page", refused="no operator seen yet")),
    ]
    shown = play(causes(*given))
    assert texts(shown) == [
        "Engines are off, not turned on since engine_controller started",
        "Engines are on",
        "Engines are off, turned off by operator_page",
    ]
    assert times(shown) == [1.0, 2.0, 3.05]


def test_new_complaint_of_a_service_is_shown_once(play: Play) -> None:
    def health(time: float, complaint: str) -> Message:
        level = DiagnosticStatus.WARN if complaint else DiagnosticStatus.OK
        mine = DiagnosticStatus(name="/velocity", level=level, message=complaint or "running")
        fine = DiagnosticStatus(name="/kinematics", level=DiagnosticStatus.OK, message="running")
        others = DiagnosticStatus(name="/arm2/velocity", level=DiagnosticStatus.WARN, message=f"at {time} s")
        return time, topics.DIAGNOSTICS, DiagnosticArray(status=[mine, fine, others])

    script = [
        health(time, complaint) for time, complaint in enumerate(["", "bad", "bad", "worse", "", "worse"], 1)
    ]
    assert texts(play(script)) == ["velocity: bad", "velocity: worse", "velocity: worse"]


def test_clock_of_another_host_is_shown_when_it_is_known_and_when_that_matters(play: Play) -> None:
    def clocks(time: float, behind: str, name: str = "/engine_controller") -> Message:
        values = [KeyValue(key="clock of host desk", value=behind)]
        status = DiagnosticStatus(name=name, hardware_id="robot1", values=values)
        return time, topics.DIAGNOSTICS, DiagnosticArray(status=[status])

    script = [
        clocks(1.0, "9.0", name="/arm2/engine_controller"),
        clocks(2.0, "0.003"),
        clocks(3.0, "0.01"),
        clocks(4.0, "-0.06"),
        clocks(5.0, "-60.0"),
        clocks(6.0, "?"),
        clocks(7.0, "60.0"),
        clocks(8.0, "0.0"),
    ]
    assert [(line.time.timestamp(), line.text) for line in play(script)] == [
        (2.0, "the clock of host desk is 3 ms behind that of robot1"),
        (4.0, "the clock of host desk is 60 ms ahead of that of robot1"),
        (7.0, "the clock of host desk is 60.0 s behind that of robot1"),
        (8.0, "the clock of host desk is 0 ms ahead of that of robot1"),
    ]


def processes(time: float, restarts: int, pid: int, age: float = 0.25, host: str = "robot1") -> Message:
    """What the sentinel reports; the process is `age` old, and there was none for 0.05 s before."""
    state = "RUNNING" if pid else "BACKOFF"
    program = Program("kinematics", state, pid, age, restarts, "code 1", "", 0.05)
    (status,) = sentinel.states([program], {}, {}, "/sentinel")
    status.hardware_id = host
    return time, topics.DIAGNOSTICS, DiagnosticArray(status=[status])


def alive(time: float, pid: int, *, host: str = "robot1", problem: str = "") -> Message:
    pairs = {"pid": str(pid), "published": "1", "seconds_since_output": ""}
    values = [KeyValue(key=key, value=value) for key, value in pairs.items()]
    level = DiagnosticStatus.WARN if problem else DiagnosticStatus.OK
    status = DiagnosticStatus(name="/kinematics", level=level, message=problem or "running", values=values)
    status.hardware_id = host
    return time, topics.DIAGNOSTICS, DiagnosticArray(status=[status])


def deaths(lines: Iterable[Line]) -> list[str]:
    return [line.text for line in lines if line.kind is Kind.PROCESS]


DIED = "kinematics died (code 1), back after {} s".format


@pytest.mark.parametrize("health", [2.9, 3.5])
def test_death_and_return_of_a_process_are_told_with_their_times(play: Play, health: float) -> None:
    """Whether the sentinel or the process itself reports first."""
    script = [processes(1, 2, pid=7), alive(1.5, pid=7), processes(3, 3, pid=8), alive(health, pid=8)]
    shown = play([*script, processes(4, 3, pid=8, age=0.9), processes(5, 3, pid=8, age=1.9)])
    assert texts(shown) == [DIED(round(health - 2.7, 1))]
    assert times(shown) == [health], "when it was back"


def test_process_that_is_away_is_told_when_it_returns(play: Play) -> None:
    away = [processes(1, 0, pid=7), alive(1.5, pid=7), processes(2, 0, pid=0), processes(3, 1, pid=0)]
    shown = play([*away, processes(4, 2, pid=9), alive(4.1, pid=9), processes(5, 2, pid=9)])
    assert deaths(shown) == ["kinematics died 2 times, last (code 1), back after 0.4 s"]


def test_process_that_dies_before_it_is_back_counts_as_away(play: Play) -> None:
    script = [processes(1, 0, pid=7), processes(2, 1, pid=8), processes(3, 2, pid=9), alive(3.1, pid=9)]
    assert deaths(play([*script, processes(4, 2, pid=9)])) == [
        "kinematics died 2 times, last (code 1), back after 0.4 s"
    ]


def test_new_supervisord_is_no_death_of_its_processes(play: Play) -> None:
    script = [processes(1, 3, pid=7), processes(2, 0, pid=8), alive(2.1, pid=8), processes(3, 0, pid=8)]
    script += [processes(4, 1, pid=9), alive(4.1, pid=9), processes(5, 1, pid=9)]
    assert deaths(play(script)) == [DIED(0.4)]


def test_program_that_two_hosts_run_is_told_apart(play: Play) -> None:
    script = [processes(1, 0, pid=7), alive(1.1, pid=7)]
    for second in (2, 3, 4):
        script += [processes(second, 0, pid=7), processes(second + 0.2, 5, pid=8, host="robot2")]
        script += [alive(second + 0.4, pid=7), alive(second + 0.6, pid=8, host="robot2", problem="too old")]
    assert texts(play(script)) == ["kinematics: too old"]


@pytest.mark.parametrize("age", [-1e300, 1e300, math.inf, math.nan])
def test_report_with_an_impossible_time_is_ignored(play: Play, age: float) -> None:
    odd = processes(1, 0, pid=7, age=age)
    assert texts(play([odd, *causes((2, Cause("on", "turn_on")))])) == ["Engines are on"]


def test_fast_lines_are_thinned_to_one_a_second(play: Play) -> None:
    speeds = values(*((n / 20, topics.EFFECTOR_SPEED, n) for n in range(1, 20 * 20)))
    shown = times(play(speeds))
    assert len([time for time in shown if time < 1.0]) == 6
    assert [later - sooner for sooner, later in pairwise(shown[6:])] == pytest.approx([1.0] * 18, abs=0.06)


def test_thinned_lines_of_different_kinds_are_of_the_same_moment(play: Play) -> None:
    speeds = values(*((n / 20, topics.EFFECTOR_SPEED, n) for n in range(1, 20 * 20)))
    positions = [(n / 20, topics.EFFECTOR_POSITION, Position(0, 0.0, 0.0)) for n in range(7, 20 * 20)]
    shown = [time for time in times(play(speeds + positions)) if time >= 2.0]
    assert shown == [float(second) for second in range(2, 20) for _ in range(2)]


def test_pause_refills_the_burst(play: Play) -> None:
    speeds = [start + n / 20 for start in (0, 30) for n in range(1, 15)]
    assert len(play(values(*((time, topics.EFFECTOR_SPEED, time) for time in speeds)))) == 12


def test_clock_that_is_set_back_hides_no_lines() -> None:
    allowance = Allowance(1)
    shown = [allowance.covers(ORIGIN + timedelta(seconds=time)) for time in (1000, 1, 2, 2)]
    assert shown == [True, False, True, False]


def test_all_heartbeats_of_the_listing_are_shown(play: Play) -> None:
    times = (1.942, 1.991, 2.041, 2.091, 2.141, 2.192, 2.242, 2.292, 2.342, 2.392, 4.444)
    script = [(time, topics.OPERATOR_HEARTBEAT, True) for time in times]
    assert len(play(script)) == len(times)
