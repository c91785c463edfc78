"""What the operator's terminal shows, in virtual time: a tick is a second."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import timedelta
from itertools import pairwise
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import Point, PointStamped
from reactivex import Observable
from reactivex import operators as ops
from reactivex.testing import ReactiveTest, TestScheduler
from std_msgs.msg import Bool, Float64, Header, String

from deploy.console import view
from interfaces import topics
from reactive_node.stamps import Timestamp

Message = tuple[float, topics.Topic, Any]
"""When it arrives [s], on which topic, and what."""
Play = Callable[..., list[tuple[float, str]]]


@pytest.fixture
def play() -> Play:
    """
    Plays messages; returns the lines that the terminal shows, each with the time at which it does.

    `late` is a message that was sent 20 ms before it arrives.
    """

    def play(
        script: Iterable[Message], *, begin: float = 0.0, until: float = 60.0, late: Any = None
    ) -> list[tuple[float, str]]:
        scheduler = TestScheduler()

        def sent(message: Any) -> Timestamp[Any]:
            age = timedelta(milliseconds=20 if message is late else 0)
            return Timestamp(value=message, timestamp=scheduler.now - age)

        def seen(topic: topics.Topic) -> Observable[Any]:
            arrivals = [ReactiveTest.on_next(at, message) for at, on, message in script if on is topic]
            return scheduler.create_hot_observable(arrivals).pipe(ops.map(sent))

        # RxPY takes 0 for none.
        shown = scheduler.start(lambda: view.view(seen, begin), created=1e-9, subscribed=1e-9, disposed=until)
        return [(round(line.time, 3), line.value.value.text) for line in shown.messages]

    return play


def presences(*times: float) -> list[Message]:
    return [(time, topics.OPERATOR_PRESENCE, Header()) for time in times]


def commands(command: str, *times: float) -> list[Message]:
    return [(time, topics.ENGINES, String(data=command)) for time in times]


def values(*changes: tuple[float, topics.Topic, float]) -> list[Message]:
    return [(time, topic, Float64(data=value)) for time, topic, value in changes]


def texts(shown: list[tuple[float, str]]) -> list[str]:
    return [text for _, text in shown]


LATER = 100.0


def test_data_are_shown_when_all_four_values_are_known_and_at_each_change(play: Play) -> None:
    script = values((1, topics.L1, 2), (1, topics.L2, 3), (1, topics.THETA1, 0.785398))
    script += values((2, topics.THETA2, 0.5), (3, topics.THETA2, 1.785398))
    assert texts(play(script, begin=LATER)) == [
        "### Received new data: {2, 3, 0.785398, 0.5}",
        "### Received new data: {2, 3, 0.785398, 1.7854}",
    ]


def test_lines_stand_in_the_order_in_which_their_messages_were_sent(play: Play) -> None:
    sent_first = PointStamped(point=Point(x=-3.4029603, y=3.1472500))
    script = [
        (1.0, topics.EFFECTOR_SPEED, Float64(data=3.318452)),
        (1.01, topics.EFFECTOR_POSITION, sent_first),
    ]
    assert texts(play(script, begin=LATER, late=sent_first)) == [
        "Position x: -3.40296 and y: 3.14725",
        "Speed: 3.31845 [m/s]",
    ]


def test_each_heartbeat_of_a_pressed_switch_is_shown(play: Play) -> None:
    script = [
        (at, topics.OPERATOR_HEARTBEAT, Bool(data=pressed))
        for at, pressed in ((1, True), (2, False), (3, True))
    ]
    assert texts(play(script, begin=LATER)) == ["### Received signal from operator"] * 2


ASLEEP = ["Not received signal from operator...", "Operator is sleeping !!!", "Turning off engines..."]


@pytest.mark.parametrize("command", [13.49, 13.51])
def test_an_operator_who_is_away_is_missed_every_3_s_until_the_command_comes(
    play: Play, command: float
) -> None:
    script = presences(1, 2, 4.5) + commands(topics.TURN_OFF, *(command + 0.5 * n for n in range(20)))
    shown = play(script)
    assert shown[3:5] == [(time, "Not received signal from operator...") for time in (7.52, 10.52)]
    assert texts(shown[5:]) == ASLEEP


def test_an_operator_who_never_came_is_missed_from_the_beginning_of_the_scenario_on(play: Play) -> None:
    assert play([], begin=5.0, until=12.0) == [
        (8.02, "Not received signal from operator..."),
        (11.02, "Not received signal from operator..."),
    ]


def test_an_operator_who_comes_back_can_be_missed_again(play: Play) -> None:
    script = presences(1) + commands(topics.TURN_OFF, 10, 10.5)
    script += presences(11) + commands(topics.TURN_OFF, 20, 20.5)
    shown = texts(play(script, until=30.0))
    assert shown.count("Operator is sleeping !!!") == 2
    assert shown[-3:] == ASLEEP


def test_a_command_while_the_operator_is_there_puts_nobody_to_sleep(play: Play) -> None:
    script = presences(1, 1.5, 2) + commands(topics.TURN_ON, 1.2) + commands(topics.TURN_OFF, 1.7)
    assert texts(play(script, until=3.0)) == [
        "Operator is alive",
        "Turning on engines...",
        "Operator is alive",
        "Turning off engines...",
        "Operator is alive",
    ]


def test_the_engines_are_shown_when_they_change(play: Play) -> None:
    states = {1: "off", 2: "off", 3: "on"}
    script = [(time, topics.ENGINES_STATE, String(data=state)) for time, state in states.items()]
    assert texts(play(script, begin=LATER)) == ["Engines are off", "Engines are on"]


def test_a_service_is_shown_when_it_complains_about_something_new(play: Play) -> None:
    def health(time: float, complaint: str) -> Message:
        level = DiagnosticStatus.WARN if complaint else DiagnosticStatus.OK
        mine = DiagnosticStatus(name="/velocity", level=level, message=complaint or "running")
        others = DiagnosticStatus(name="/arm2/velocity", level=DiagnosticStatus.WARN, message=f"at {time} s")
        return time, topics.DIAGNOSTICS, DiagnosticArray(status=[mine, others])

    script = [
        health(time, complaint) for time, complaint in enumerate(["", "bad", "bad", "worse", "", "worse"], 1)
    ]
    assert texts(play(script, begin=LATER)) == ["velocity: bad", "velocity: worse", "velocity: worse"]


def test_lines_that_come_too_fast_are_thinned_to_one_a_second(play: Play) -> None:
    speeds = values(*((n / 20, topics.EFFECTOR_SPEED, n) for n in range(1, 20 * 20)))
    times = [time for time, _ in play(speeds, begin=LATER)]
    assert len([time for time in times if time <= 1.0]) == 6
    assert [later - sooner for sooner, later in pairwise(times[6:])] == pytest.approx([1.0] * 18, abs=0.06)


def test_all_heartbeats_of_the_listing_are_shown(play: Play) -> None:
    times = (1.942, 1.991, 2.041, 2.091, 2.141, 2.192, 2.242, 2.292, 2.342, 2.392, 4.444)
    script = [(time, topics.OPERATOR_HEARTBEAT, Bool(data=True)) for time in times]
    assert len(play(script, begin=LATER)) == len(times)
