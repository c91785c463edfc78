from __future__ import annotations

import os
import re
import sys
import time
from collections.abc import Callable, Iterator
from itertools import pairwise

import pytest
from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import Bool, String

from deploy.operator import hand, remote
from deploy.operator.switch import ECHO
from deploy.operator.terminal import plain
from deploy.operator.terminal import terminal as program
from deploy.operator.terminal.terminal import Terminal
from interfaces.service import ServiceNode
from interfaces.topics import ENGINES, ENGINES_STATE, OFF, ON, OPERATOR_HEARTBEAT, TURN_OFF, TURN_ON
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
from services import dead_mans_switch

Live = Callable[[Callable[[], object]], None]


class Operator:
    def __init__(self, node: Node, terminal: Terminal, keyboard: int) -> None:
        self.node = node
        self._terminal = terminal
        self._keyboard = keyboard

    def type(self, word: str) -> None:
        os.write(self._keyboard, f"{word}\n".encode())
        self.live()

    def live(self) -> None:
        self._terminal.refresh()


@pytest.fixture
def operator(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> Iterator[Operator]:
    monkeypatch.setattr(program, "AGAIN", 0.2)
    monkeypatch.setattr(program, "PERIOD", 0.01)
    monkeypatch.setattr(hand, "LONGEST_PAUSE", 0.5)
    monkeypatch.setattr(remote, "TIMEOUT", 0.5)
    reading, writing = os.pipe()
    with open(reading) as keyboard, open(writing, "wb"):
        monkeypatch.setattr(sys, "stdin", keyboard)
        node = make_node("terminal", kind=ReactiveNode)
        with Terminal(node, time.monotonic()) as terminal:
            yield Operator(node, terminal, writing)


class Controller:
    def __init__(self, make_node: MakeNode) -> None:
        self.engines = ON
        self.commands: list[str] = []
        node = make_node("controller", kind=Node)
        publisher = node.create_publisher(String, ENGINES_STATE.name, ENGINES_STATE.qos)
        node.create_timer(0.05, lambda: publisher.publish(String(data=self.engines)))
        node.create_subscription(String, ENGINES.name, lambda it: self.commands.append(it.data), ENGINES.qos)


def test_turn_off_reaches_a_controller_that_starts_later(
    operator: Operator, make_node: MakeNode, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    operator.type("turn_off")
    controller = Controller(make_node)
    spin_until(lambda: TURN_OFF in controller.commands)

    controller.engines = OFF
    spin_for(0.3)
    controller.commands.clear()
    spin_for(0.5)

    assert controller.commands == []


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
        self.heartbeats: list[float] = []
        given = [Parameter(name, value=value) for name, value in values.items()]
        self.node = make_node("dead_mans_switch", kind=ServiceNode, parameter_overrides=given)
        dead_mans_switch.wire(self.node)
        self.node.create_subscription(
            Bool,
            OPERATOR_HEARTBEAT.name,
            lambda _: self.heartbeats.append(time.monotonic()),
            OPERATOR_HEARTBEAT.qos,
        )

    @property
    def pressed(self) -> bool:
        return bool(self.node.get_parameter("pressed").value)

    def set(self, pressed: bool) -> None:
        self.node.set_parameters([Parameter("pressed", value=pressed)])


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the terminal says of the hand, each with its time."""
    said: list[str] = []

    def say(line: str) -> None:
        if found := re.fullmatch(r"\[\d+\] ((Released|Another hand|dead_mans_switch).*)", line):
            said.append(found[1])

    monkeypatch.setattr(plain, "say", say)
    return said


@pytest.fixture
def live_until(operator: Operator, executor: Executor) -> Live:
    """Lets the terminal live, as `make terminal` does, until a condition is true."""

    def until(condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + 10.0
        while not condition():
            assert time.monotonic() < deadline, "the condition was not true in time"
            executor.spin_until_future_complete(Future(), timeout_sec=0.01)
            operator.live()

    return until


@pytest.fixture
def held(operator: Operator, make_node: MakeNode, live_until: Live) -> Switch:
    switch = Switch(make_node, pressed=True)
    operator.type("press")
    live_until(lambda: not switch.pressed)
    switch.heartbeats.clear()
    live_until(lambda: len(switch.heartbeats) > 5)
    return switch


def test_terminal_that_holds_sends_the_heartbeats_itself(held: Switch, said: list[str]) -> None:
    gaps = [later - sooner for sooner, later in pairwise(held.heartbeats)]
    assert max(gaps) < 0.5
    assert not held.pressed
    assert said == []


def test_release_ends_the_heartbeats(
    held: Switch, operator: Operator, live_until: Live, said: list[str]
) -> None:
    operator.type("release")
    assert_silence(held, live_until)
    assert said == []


def test_terminal_that_stood_still_has_to_press_again(
    held: Switch, operator: Operator, live_until: Live, spin_for: SpinFor, said: list[str]
) -> None:
    spin_for(2 * hand.LONGEST_PAUSE)
    assert held.heartbeats[-1] < time.monotonic() - hand.LONGEST_PAUSE
    assert_silence(held, live_until)
    assert len(said) == 1
    assert re.fullmatch(hand.PAUSED.format(r"no beat came for \d+ ms"), said[0])

    operator.type("press")
    held.heartbeats.clear()
    live_until(lambda: len(held.heartbeats) > 5)


@pytest.mark.parametrize("pressed", [False, True])
def test_another_hand_takes_the_switch_from_the_terminal(
    held: Switch, live_until: Live, said: list[str], pressed: bool
) -> None:
    live_for(ECHO, live_until)
    held.set(pressed)
    live_until(lambda: said)
    assert said == [hand.TAKEN]
    held.set(False)
    assert_silence(held, live_until)


def test_death_of_the_virtual_switch_releases_no_terminal(
    held: Switch, live_until: Live, make_node: MakeNode
) -> None:
    held.node.destroy_node()
    successor = Switch(make_node)
    live_until(lambda: len(successor.heartbeats) > 5)
    assert not successor.pressed


def assert_silence(switch: Switch, live_until: Live) -> None:
    """Nothing is heard of the operator any more, but for a heartbeat on its way."""
    live_for(0.2, live_until)
    switch.heartbeats.clear()
    live_for(0.5, live_until)
    assert switch.heartbeats == []


def live_for(seconds: float, live_until: Live) -> None:
    end = time.monotonic() + seconds
    live_until(lambda: time.monotonic() > end)


def test_release_reaches_the_successor_of_a_hung_switch(
    operator: Operator,
    make_node: MakeNode,
    spin_until: SpinUntil,
    spin_for: SpinFor,
    said: list[str],
) -> None:
    hung = Node("dead_mans_switch", context=operator.node.context)  # nothing spins it
    try:
        operator.type("release")
        spin_for(2 * remote.TIMEOUT)
        assert said == ["dead_mans_switch does not answer: trying again until it does"]
    finally:
        hung.destroy_node()
    switch = Switch(make_node, pressed=True)

    spin_until(lambda: not switch.pressed)


def test_newest_command_to_the_switch_wins(operator: Operator, make_node: MakeNode, live_until: Live) -> None:
    operator.type("press")
    operator.type("release")
    switch = Switch(make_node, pressed=True)

    live_until(lambda: not switch.pressed)
    live_for(1.5 * remote.TIMEOUT, live_until)
    assert_silence(switch, live_until)
    assert not switch.pressed
