"""The commands at the operator's terminal reach the arm."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from deploy.console import console
from deploy.console.console import Console
from deploy.console.page import remote
from interfaces.service import ServiceNode
from interfaces.topics import ENGINES, ENGINES_STATE, OFF, ON, TURN_OFF, TURN_ON
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
from services import dead_mans_switch


class Operator:
    """Types at a terminal."""

    def __init__(self, node: Node, terminal: Console, keyboard: int) -> None:
        self.node = node
        self._terminal = terminal
        self._keyboard = keyboard

    def type(self, word: str) -> None:
        os.write(self._keyboard, f"{word}\n".encode())
        self._terminal.refresh()


@pytest.fixture
def operator(make_node: MakeNode, monkeypatch: pytest.MonkeyPatch) -> Iterator[Operator]:
    monkeypatch.setattr(console, "AGAIN", 0.2)
    monkeypatch.setattr(remote, "TIMEOUT", 0.5)
    reading, writing = os.pipe()
    with open(reading) as keyboard, open(writing, "wb"):
        monkeypatch.setattr(sys, "stdin", keyboard)
        node = make_node("terminal", kind=ReactiveNode)
        with Console(node, time.monotonic()) as terminal:
            yield Operator(node, terminal, writing)


class Controller:
    """An engine controller that repeats its state."""

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


def test_release_reaches_the_successor_of_a_hung_switch(
    operator: Operator,
    make_node: MakeNode,
    spin_until: SpinUntil,
    spin_for: SpinFor,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    said: list[str] = []
    monkeypatch.setattr(console, "say", said.append)
    hung = Node("dead_mans_switch", context=operator.node.context)  # nothing spins it
    try:
        operator.type("release")
        spin_for(2 * remote.TIMEOUT)
        assert said == ["dead_mans_switch does not answer: trying again until it does"]
    finally:
        hung.destroy_node()
    held = [Parameter("pressed", value=True)]
    switch = make_node("dead_mans_switch", kind=ServiceNode, parameter_overrides=held)
    dead_mans_switch.wire(switch)

    spin_until(lambda: switch.get_parameter("pressed").value is False)


def test_newest_command_to_the_switch_wins(
    operator: Operator, make_node: MakeNode, spin_until: SpinUntil, spin_for: SpinFor
) -> None:
    operator.type("press")
    operator.type("release")
    switch = make_node("dead_mans_switch", kind=ServiceNode)
    dead_mans_switch.wire(switch)
    pressed = []
    switch.add_post_set_parameters_callback(lambda given: pressed.extend(it.value for it in given))

    spin_until(lambda: pressed)
    spin_for(1.5 * remote.TIMEOUT)

    assert pressed == [False]
