"""Why the engines are on or off, as their controller says it; in virtual time, with ten ticks a second."""

from __future__ import annotations

import itertools
import socket
from typing import Any

import pytest
import reactivex as rx
from diagnostic_msgs.msg import DiagnosticArray, KeyValue
from reactivex.testing import ReactiveTest, TestScheduler
from std_msgs.msg import Header, String

from interfaces import cause
from interfaces.cause import PAUSED, STARTED, UNSEEN, Cause
from interfaces.explanation import Sender, engine_causes
from interfaces.latch import Command, Presence
from interfaces.topics import (
    ENGINES,
    ENGINES_CAUSE,
    ENGINES_SENDER,
    ENGINES_STATE,
    OFF,
    ON,
    OPERATOR_HAND,
    OPERATOR_NODES,
    OPERATOR_PRESENCE,
    TURN_OFF,
    TURN_ON,
)
from reactive_node import stamps
from services import engine_controller
from services.engine_controller import turns
from tests.component.wiring import Connect, Wired

on_next = ReactiveTest.on_next


class Play:
    """A virtual operator is seen twice a second; times are those of arrival."""

    def __init__(self, scheduler: TestScheduler) -> None:
        self.scheduler = scheduler
        self.commands: list[Any] = []
        self.senders: list[Any] = []
        self.seen = [step / 2 for step in range(1, 40)]

    def command(self, at: float, name: str, sender: str = "", *, age: float = 0.0) -> None:
        sent = self.scheduler.to_datetime(at - age)
        self.commands.append(on_next(at, Command(self.scheduler.to_datetime(at), age, name, sent)))
        if sender:
            self.name(at + 0.001, name, sender)

    def name(self, at: float, command: str, sender: str) -> None:
        self.senders.append(on_next(at, Sender(self.scheduler.to_datetime(at), command, sender)))

    def causes(self, until: float = 25.0) -> list[tuple[float, Cause]]:
        hot = self.scheduler.create_hot_observable
        presences = [on_next(at, Presence(self.scheduler.to_datetime(at), 0.0)) for at in self.seen]

        def create() -> rx.Observable[Cause]:
            latched = turns(hot(*self.commands), hot(*presences)).share()
            return engine_causes(latched, hot(*self.senders))

        shown = self.scheduler.start(create, created=0.001, subscribed=0.002, disposed=until)
        return [(round(it.time, 3), it.value.value) for it in shown.messages]


@pytest.fixture
def play(scheduler: TestScheduler) -> Play:
    return Play(scheduler)


FIRST = (0.002, Cause(OFF, STARTED))


def rounded(causes: list[tuple[float, Cause]]) -> list[tuple[float, Cause]]:
    return [(at, it._replace(age=round(it.age, 3), since=round(it.since, 3))) for at, it in causes]


def test_cause_is_reported_once_with_the_tick_after_each_change(play: Play) -> None:
    play.command(2.25, TURN_ON, "terminal_7", age=0.3)
    play.command(5.77, TURN_OFF, "operator_page")
    assert rounded(play.causes()) == [
        FIRST,
        (2.302, Cause(ON, TURN_ON, "terminal_7", 0.3, 0.052)),
        (5.802, Cause(OFF, TURN_OFF, "operator_page", 0.0, 0.032)),
    ]


def test_command_of_a_tool_has_no_name(play: Play) -> None:
    play.command(2.2, TURN_ON)
    play.command(5.7, TURN_OFF)
    play.command(5.9, TURN_OFF, "operator_watchdog")  # they are off already
    play.command(6.4, TURN_OFF, "operator_watchdog")
    assert [(it.event, it.sender) for _, it in play.causes()] == [
        (STARTED, ""),
        (TURN_ON, ""),
        (TURN_OFF, ""),
    ]


def test_name_of_another_command_counts_for_nothing(play: Play) -> None:
    play.name(2.1, TURN_ON, "early")
    play.command(2.2, TURN_ON)
    play.name(2.3, TURN_OFF, "other")
    assert [it.sender for _, it in play.causes()] == ["", ""]


def test_name_counts_that_was_sent_in_the_moment_of_its_command(play: Play) -> None:
    play.command(2.2, TURN_ON)
    play.name(2.2, TURN_ON, "terminal_7")
    assert [it.sender for _, it in play.causes()] == ["", "terminal_7"]


def test_name_that_comes_after_the_tick_is_reported_with_the_next_one(play: Play) -> None:
    play.command(2.2, TURN_ON)
    play.name(3.5, TURN_ON, "terminal_7")
    assert [(at, it.sender) for at, it in play.causes()][1:] == [(2.202, ""), (3.502, "terminal_7")]


def test_controller_that_sees_no_operator_says_so(play: Play) -> None:
    play.command(2.2, TURN_ON, "operator_page")
    play.seen = [1.5, 2.0]
    assert rounded(play.causes())[-1] == (12.002, Cause(OFF, UNSEEN, age=10.002))


def test_controller_that_stood_still_says_so(play: Play) -> None:
    play.command(2.2, TURN_ON, "operator_page")
    play.scheduler.schedule_absolute(5.1, lambda *_: play.scheduler.sleep(4.5))
    last = rounded(play.causes())[-1][1]
    assert (last.state, last.event) == (OFF, PAUSED)
    assert 4.5 <= last.age < 5.5


def test_refused_turn_on_is_reported_until_one_is_obeyed(play: Play) -> None:
    play.seen = [at for at in play.seen if at > 4.0]
    play.command(2.2, TURN_ON, "terminal_7")
    play.command(5.2, TURN_ON, "terminal_7")
    found = rounded(play.causes(10.0))
    assert [(at, it.event, it.refused, it.since) for at, it in found] == [
        (0.002, STARTED, "", 0.0),
        (2.202, STARTED, "no operator seen yet", 2.2),
        (5.202, TURN_ON, "", 0.002),
    ]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (Cause(OFF, STARTED), "not turned on since engine_controller started"),
        (Cause(ON, TURN_ON, "terminal_7", since=3.25), "turned on by terminal_7"),
        (Cause(OFF, TURN_OFF, "operator_page"), "turned off by operator_page"),
        (Cause(OFF, TURN_OFF), "turned off by a node that gave no name"),
        (
            Cause(OFF, TURN_OFF, "operator_watchdog"),
            "turned off by operator_watchdog (operator incapacitated)",
        ),
        (Cause(OFF, UNSEEN, age=10.02), "turned off by engine_controller (no operator seen for 10.0 s)"),
        (Cause(OFF, PAUSED, age=0.52), "turned off by engine_controller (it stood still for 0.5 s)"),
    ],
)
def test_cause_is_given_in_words_and_in_values(given: Cause, words: str) -> None:
    sent = cause.message(given)
    (status,) = sent.status
    assert (status.name, status.message, status.hardware_id) == ("engines", words, socket.gethostname())
    assert cause.read(sent) == given
    assert cause.problem(sent) == ""


@pytest.mark.parametrize(
    ("key", "value", "problem"),
    [
        ("event", None, "it lacks event"),
        ("sender", "x" * 301, "a text is too long"),
        ("age", "nan", "'nan' is out of range"),
        ("state", "maybe", "'maybe' is unknown"),
        ("state", "x" * 50, f"'{'x' * 40}' is unknown"),
        ("sender", "x" * 300, ""),
    ],
)
def test_message_that_is_no_cause_has_a_problem(key: str, value: str | None, problem: str) -> None:
    sent = cause.message(Cause(OFF, STARTED))
    pairs = [pair for pair in sent.status[0].values if pair.key != key]
    sent.status[0].values = [*pairs, *([KeyValue(key=key, value=value)] if value else [])]
    assert cause.problem(sent) == problem
    assert cause.problem(DiagnosticArray()) == "it has not one status"


@pytest.fixture
def controller(connect: Connect) -> Wired:
    inputs = [ENGINES, ENGINES_SENDER, OPERATOR_PRESENCE]
    outputs = [ENGINES_STATE, ENGINES_CAUSE]
    return connect(engine_controller.wire, inputs=inputs, outputs=outputs)


def published(wired: Wired) -> list[Cause]:
    return [cause.read(each) for each in wired.heard[ENGINES_CAUSE.name]]


def turn_on(wired: Wired) -> None:
    wired.publish(OPERATOR_PRESENCE, Header(stamp=stamps.to_message(stamps.now())))
    before = len(wired.heard[ENGINES_STATE.name])
    wired.spin_until(lambda: len(wired.heard[ENGINES_STATE.name]) >= before + 2)
    wired.publish(ENGINES, String(data=TURN_ON))
    wired.publish(ENGINES_SENDER, KeyValue(key=TURN_ON, value="rqt"))
    wired.spin_until(lambda: published(wired)[-1:] != [] and published(wired)[-1].sender == "rqt")


def test_cause_is_published_with_the_name_of_the_sender(controller: Wired) -> None:
    turn_on(controller)
    controller.publish(ENGINES, String(data=TURN_OFF))
    controller.spin_until(lambda: published(controller)[-1].state == OFF)

    found = [(it.state, it.event, it.sender) for it, _ in itertools.groupby(published(controller))]
    assert found[0] == (OFF, STARTED, "")
    assert found[-2:] == [(ON, TURN_ON, "rqt"), (OFF, TURN_OFF, "")]
    assert controller.remarks() == []


def test_name_of_a_sender_commands_nothing(controller: Wired) -> None:
    turn_on(controller)
    controller.publish(ENGINES, String(data=TURN_OFF))
    controller.spin_until(lambda: published(controller)[-1].state == OFF)
    before = len(controller.heard[ENGINES_STATE.name])
    for _ in range(5):
        controller.publish(ENGINES_SENDER, KeyValue(key=TURN_ON, value="stranger"))
    controller.publish(OPERATOR_PRESENCE, Header(stamp=stamps.to_message(stamps.now())))
    controller.spin_until(lambda: len(controller.heard[ENGINES_STATE.name]) >= before + 5)
    assert {state.data for state in controller.heard[ENGINES_STATE.name][before:]} == {OFF}


def test_only_displays_read_who_holds_who_commands_and_why() -> None:
    readers = {*ENGINES_CAUSE.subscribers, *OPERATOR_HAND.subscribers, *ENGINES_SENDER.subscribers}
    assert readers == {*OPERATOR_NODES, "engine_controller"}


def test_error_in_a_cause_ends_the_causes_and_not_the_controller(
    connect: Connect, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(*_: Any) -> Any:
        raise LookupError("planted")

    monkeypatch.setattr(cause, "message", fails)
    inputs, outputs = [ENGINES, OPERATOR_PRESENCE], [ENGINES_STATE]
    wired = connect(engine_controller.wire, inputs=inputs, outputs=outputs)
    wired.spin_until(lambda: len(wired.heard[ENGINES_STATE.name]) >= 5)

    assert wired.heard[ENGINES_STATE.name][-1].data == OFF
    assert any("engines/cause: not published: LookupError('planted')" in each for each in wired.remarks())
