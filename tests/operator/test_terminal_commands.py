from __future__ import annotations

import os
import re
import sys
import threading
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from io import RawIOBase

import pytest
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import Bool, Header, String

from deploy.operator import hand, hold, remote
from deploy.operator.terminal import plain
from deploy.operator.terminal import terminal as program
from deploy.operator.terminal.terminal import Terminal
from deploy.supervision import reaction
from interfaces.service import ServiceNode
from interfaces.topics import (
    ENGINES,
    ENGINES_STATE,
    OFF,
    ON,
    OPERATOR_HAND,
    OPERATOR_HEARTBEAT,
    TURN_OFF,
    TURN_ON,
)
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
from services import dead_mans_switch


class Clock:
    """The clock of the hand: it goes on while the terminal lives, so no busy machine releases the hand."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class Operator:
    def __init__(self, node: Node, terminal: Terminal, keyboard: RawIOBase, executor: Executor) -> None:
        self.node = node
        self.said: list[str] = []
        """What the terminal says of the hand."""
        self._terminal = terminal
        self._keyboard = keyboard
        self._executor = executor

    def say(self, line: str) -> None:
        found = re.fullmatch(r"\[\d+\] ((Released|Another hand|dead_mans_switch).*)", line)
        if found and threading.current_thread() is threading.main_thread():  # that of the executor
            self.said.append(found[1])

    def type(self, word: str) -> None:
        self._keyboard.write(f"{word}\n".encode())
        self.live()

    def end_input(self) -> None:
        self._keyboard.close()

    def live(self) -> None:
        assert isinstance(hold.monotonic, Clock)
        hold.monotonic.now += program.PERIOD
        self._terminal.refresh()

    def live_until(self, condition: Callable[[], object]) -> None:
        """Let the terminal live, as `make terminal` does, until a condition is true."""
        deadline = time.monotonic() + 60.0
        while not condition():
            assert time.monotonic() < deadline, "the condition was not true in time"
            self._executor.spin_until_future_complete(Future(), timeout_sec=0.01)
            self.live()

    def live_for(self, seconds: float) -> None:
        """Let the terminal live for some seconds, or longer where the machine pauses."""
        turns = iter(range(round(seconds / program.PERIOD)))
        self.live_until(lambda: next(turns, None) is None)

    def assert_silence(self, switch: Switch) -> None:
        """Nothing is heard of the operator any more, but for a heartbeat on its way."""
        self.live_for(0.2)
        switch.heartbeats.clear()
        self.live_for(0.5)
        assert switch.heartbeats == []


@pytest.fixture
def operator(make_node: MakeNode, executor: Executor, monkeypatch: pytest.MonkeyPatch) -> Iterator[Operator]:
    monkeypatch.setattr(program, "AGAIN", 0.2)
    monkeypatch.setattr(program, "PERIOD", 0.01)
    monkeypatch.setattr(hand, "LONGEST_PAUSE", 0.5)
    monkeypatch.setattr(hold, "monotonic", Clock())
    monkeypatch.setattr(remote, "TIMEOUT", 0.5)
    reading, writing = os.pipe()
    with open(reading) as keyboard, open(writing, "wb", buffering=0) as typing:
        monkeypatch.setattr(sys, "stdin", keyboard)
        node = make_node("terminal", kind=ReactiveNode)
        with Terminal(node, time.monotonic()) as terminal:
            operator = Operator(node, terminal, typing, executor)
            monkeypatch.setattr(plain, "say", operator.say)
            yield operator


class Controller:
    def __init__(self, make_node: MakeNode) -> None:
        self.engines = ON
        self.commands: list[str] = []
        self.last = 0.0  # when a command came
        node = make_node("controller", kind=Node)
        publisher = node.create_publisher(String, ENGINES_STATE.name, ENGINES_STATE.qos)
        node.create_timer(0.05, lambda: publisher.publish(String(data=self.engines)))
        node.create_subscription(String, ENGINES.name, self._hear, ENGINES.qos)

    def _hear(self, command: String) -> None:
        self.commands.append(command.data)
        self.last = time.monotonic()


def test_turn_off_reaches_a_controller_that_starts_later(
    operator: Operator, make_node: MakeNode, spin_until: SpinUntil
) -> None:
    operator.type("turn_off")
    controller = Controller(make_node)
    spin_until(lambda: TURN_OFF in controller.commands)

    controller.engines = OFF
    spin_until(lambda: time.monotonic() > controller.last + 5 * program.AGAIN)  # its repetition ends

    assert set(controller.commands) == {TURN_OFF}


def test_turn_on_ends_the_repetition_of_turn_off(
    operator: Operator, make_node: MakeNode, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    controller = Controller(make_node)
    operator.type("turn_off")
    spin_until(lambda: controller.commands.count(TURN_OFF) > 1)

    operator.type("turn_on")
    spin_until(lambda: controller.commands[-1] == TURN_ON)
    spin_for(0.5)

    assert controller.commands[-1] == TURN_ON


class Switch:
    def __init__(self, make_node: MakeNode, **values: object) -> None:
        self.heartbeats: list[Bool] = []
        self.hands: list[Header] = []
        given = [Parameter(name, value=value) for name, value in values.items()]
        self.node = make_node("dead_mans_switch", kind=ServiceNode, parameter_overrides=given)
        dead_mans_switch.wire(self.node)
        self.node.create_subscription(
            Bool, OPERATOR_HEARTBEAT.name, self.heartbeats.append, OPERATOR_HEARTBEAT.qos
        )
        self.node.create_subscription(Header, OPERATOR_HAND.name, self.hands.append, OPERATOR_HAND.qos)

    @property
    def pressed(self) -> bool:
        return bool(self.node.get_parameter("pressed").value)

    def set(self, pressed: bool) -> None:
        self.node.set_parameters([Parameter("pressed", value=pressed)])


@pytest.fixture
def held(operator: Operator, make_node: MakeNode) -> Switch:
    switch = Switch(make_node, pressed=True)
    operator.type("press")
    operator.live_until(lambda: not switch.pressed)
    switch.heartbeats.clear()
    operator.live_until(lambda: len(switch.heartbeats) > 5)
    return switch


@pytest.mark.timed
def test_terminal_that_holds_sends_the_heartbeats_itself(
    held: Switch, operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    an_hour_ago = datetime.now(UTC) - timedelta(hours=1)  # the time of day is set back
    monkeypatch.setattr("reactivex.scheduler.scheduler.default_now", lambda: an_hour_ago)
    held.hands.clear()
    operator.live_until(lambda: held.hands)

    assert {it.frame_id for it in held.hands} == {operator.node.get_name()}
    assert {it.data for it in held.heartbeats} == {True}
    assert not held.pressed
    assert operator.said == []


def test_terminal_beats_as_often_as_a_switch_and_may_stand_still_for_a_second() -> None:
    assert (hand.BEAT_PERIOD, hand.LONGEST_PAUSE) == (reaction.BEAT, 1.0)


@pytest.mark.timed
def test_release_ends_the_heartbeats(held: Switch, operator: Operator) -> None:
    operator.type("release")
    operator.assert_silence(held)
    assert operator.said == []


@pytest.mark.timed
def test_terminal_that_stood_still_has_to_press_again(held: Switch, operator: Operator) -> None:
    assert isinstance(hold.monotonic, Clock)
    hold.monotonic.now += 2 * hand.LONGEST_PAUSE
    operator.assert_silence(held)
    assert len(operator.said) == 1
    assert re.fullmatch(hand.PAUSED.format(r"no beat came for \d+ ms"), operator.said[0])

    operator.type("press")
    held.heartbeats.clear()
    operator.live_until(lambda: len(held.heartbeats) > 5)


@pytest.mark.timed
def test_end_of_the_input_ends_the_hand_but_not_the_terminal(held: Switch, operator: Operator) -> None:
    operator.end_input()
    operator.live_until(lambda: operator.said)
    assert operator.said == [hand.INPUT_ENDED]
    operator.assert_silence(held)


@pytest.mark.parametrize("pressed", [False, True])
@pytest.mark.timed
def test_another_hand_takes_the_switch_from_the_terminal(
    held: Switch, operator: Operator, pressed: bool
) -> None:
    held.set(pressed)
    operator.live_until(lambda: operator.said)
    assert operator.said == [hand.TAKEN]
    held.set(False)
    operator.assert_silence(held)


@pytest.mark.timed
def test_death_of_the_virtual_switch_releases_no_terminal(
    held: Switch, operator: Operator, make_node: MakeNode
) -> None:
    held.node.destroy_node()
    successor = Switch(make_node)
    operator.live_until(lambda: len(successor.heartbeats) > 5)
    assert not successor.pressed


def test_release_reaches_the_successor_of_a_hung_switch(
    operator: Operator, make_node: MakeNode, spin_until: SpinUntil
) -> None:
    hung = Node("dead_mans_switch", context=operator.node.context)  # nothing spins it
    try:
        operator.type("release")
        spin_until(lambda: operator.said)
        assert operator.said == ["dead_mans_switch does not answer: trying again until it does"]
    finally:
        hung.destroy_node()
    switch = Switch(make_node, pressed=True)

    spin_until(lambda: not switch.pressed)


def test_newest_command_to_the_switch_wins(operator: Operator, make_node: MakeNode) -> None:
    operator.type("press")
    operator.type("release")
    switch = Switch(make_node, pressed=True)

    operator.live_until(lambda: not switch.pressed)
    operator.live_for(1.5 * remote.TIMEOUT)
    operator.assert_silence(switch)
    assert not switch.pressed
