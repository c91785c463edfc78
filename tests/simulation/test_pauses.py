"""A pause between any two readings of a clock makes what has arrived older, never younger."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import rclpy
import reactivex as rx
from geometry_msgs.msg import Twist, Vector3
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from rclpy_simulation import Delay, Network, Process, Simulation
from std_msgs.msg import Header, String

from interfaces import topics
from interfaces.topics import DRIVE_TIMEOUT, ON, TURN_ON
from reactive_node import ReactiveNode, stamps
from services.drive import LONGEST_STEP
from services.examples.twist_gate import COMMANDS
from tests.simulation.machine import simulated_services

STEPS, TIMES = 40, 3
"""The process pauses at each of so many steps after a message, several times: its timers step as well."""
ROUNDS = STEPS * TIMES
MESSAGES, REST = 15, 4.0  # of a round; s of silence after them
RATE = 25.0  # Hz of the drive
PERIOD = 3.0  # s
TICKS = replace(topics.ENGINES, name="ticks")


@pytest.fixture
def simulation() -> Iterator[Simulation]:
    with simulated_services("pauses", Network()) as simulation:
        yield simulation


class Pauses:
    """Pauses a process after the last message of each round, and notes what it publishes."""

    def __init__(
        self, simulation: Simulation, process: Process, heard: topics.Topic, sent: topics.Topic, length: float
    ) -> None:
        self.ends: list[float] = []
        """When the last message of each round was sent [s]."""
        self.sent: list[tuple[float, Any]] = []
        self._simulation, self._process, self._length = simulation, process, length
        self._topics = f"rt/{heard.name}", f"rt/{sent.name}"
        self._topic, self._heard = sent, 0
        simulation.tap(self._note)

    def _note(self, writer: Any, sample: Any) -> None:
        now = self._simulation.now
        if writer.topic == self._topics[1]:
            message = deserialize_message(sample.data, self._topic.type)
            self.sent.append((now, self._topic.value(message)))
        if writer.topic == self._topics[0]:
            self._heard += 1
            if self._heard % MESSAGES == 0:
                self.ends.append(now)
                self._process.stop_after(1 + len(self.ends) % STEPS)
                self._simulation.after(self._length, self._go_on)

    def _go_on(self) -> None:
        self._process.stop_after(0)
        self._process.proceed()

    def after(self, end: float, pause: float) -> list[Any]:
        """Return what the process has sent in the silence, from a time after its begin on [s]."""
        return [each for each in self.sent if end + pause <= each[0] < end + REST]


def say_on() -> None:
    rclpy.init()
    publisher = publisher_of(rclpy.create_node("controller"), topics.ENGINES_STATE)
    for _ in range(ROUNDS):
        for _ in range(MESSAGES):
            time.sleep(0.1)
            publisher.publish(String(data=ON))
        time.sleep(REST)


def be_present() -> None:
    rclpy.init()
    node = rclpy.create_node("watchdog")
    presences, commands = (publisher_of(node, topic) for topic in (topics.OPERATOR_PRESENCE, topics.ENGINES))
    for _ in range(ROUNDS):
        for _ in range(MESSAGES):
            time.sleep(0.1)
            commands.publish(String(data=TURN_ON))
            presences.publish(Header(stamp=stamps.to_message(stamps.now())))
        time.sleep(REST)


def steer() -> None:
    rclpy.init()
    node = rclpy.create_node("controller")
    states, commands = (publisher_of(node, topic) for topic in (topics.ENGINES_STATE, COMMANDS))
    for _ in range(ROUNDS):
        for message in range(MESSAGES + round(REST / 0.1)):
            time.sleep(0.05)
            commands.publish(Twist(linear=Vector3(x=1.0)))
            time.sleep(0.05)
            if message < MESSAGES:
                states.publish(String(data=ON))


def tick() -> None:
    rclpy.init()
    node = ReactiveNode("clock")
    node.publish_observable(rx.interval(PERIOD).map(lambda _: String()), String, TICKS.name)
    rclpy.spin(node)


def publisher_of(node: Node, topic: topics.Topic) -> Any:
    return node.create_publisher(topic.type, topic.name, topic.qos)


def test_drive_that_pauses_accepts_no_on_for_longer(simulation: Simulation, tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text(f"drive: {{rate: {RATE}}}\n")
    drive = simulation.start("services.drive", "--ros-args", "-p", f"scenario:={scenario}")
    pause = 2.0
    pauses = Pauses(simulation, drive, topics.ENGINES_STATE, topics.DRIVEN_TIME, pause)
    controller = simulation.start(say_on, name="controller")
    simulation.run_until(lambda: controller.ended, 1000.0)

    assert len(pauses.ends) == ROUNDS
    for end in pauses.ends:
        before = max(driven.seconds for at, driven in pauses.sent if at <= end)
        (*_, (_, stood)) = [each for each in pauses.sent if each[0] < end + pause]
        (*_, (_, last)) = pauses.after(end, pause)
        assert stood.seconds - before <= DRIVE_TIMEOUT + 1.0 / RATE
        assert last.seconds - stood.seconds <= LONGEST_STEP / RATE + 0.001


def test_controller_that_pauses_takes_no_presence_for_younger(simulation: Simulation) -> None:
    timeout, pause = 1.0, DRIVE_TIMEOUT - 0.15  # longer than a period less: after a longer pause it turns off
    given = (f"presence_timeout:={timeout}", "max_presence_age:=0.5")
    options = [word for each in given for word in ("-p", each)]
    controller = simulation.start("services.engine_controller", "--ros-args", *options)
    pauses = Pauses(simulation, controller, topics.OPERATOR_PRESENCE, topics.ENGINES_STATE, pause)
    watchdog = simulation.start(be_present, name="watchdog")
    simulation.run_until(lambda: watchdog.ended, 1000.0)

    assert len(pauses.ends) == ROUNDS
    for end in pauses.ends:
        ons = [at - end for at, state in pauses.after(end, 0.0) if state == ON]
        assert timeout - 0.2 < max(ons) < timeout


def test_gate_that_pauses_lets_no_command_pass_afterwards(simulation: Simulation) -> None:
    gate = simulation.start("services.examples.twist_gate")
    velocities = replace(COMMANDS, name="cmd_vel")
    pause = 2.0
    pauses = Pauses(simulation, gate, topics.ENGINES_STATE, velocities, pause)
    controller = simulation.start(steer, name="controller")
    simulation.run_until(lambda: controller.ended, 1000.0)

    assert len(pauses.ends) == ROUNDS
    assert any(velocity.linear.x for _, velocity in pauses.sent)
    for end in pauses.ends:  # one command may wait with its permission
        assert not any(velocity.linear.x for _, velocity in pauses.after(end, pause + 0.05))


def test_timer_of_a_node_that_pauses_is_not_late_afterwards(simulation: Simulation) -> None:
    clock = simulation.start(tick, name="clock")
    pauses = Pauses(simulation, clock, TICKS, TICKS, PERIOD - 1.0)
    simulation.run_until(lambda: len(pauses.ends) > STEPS, ROUNDS * MESSAGES * PERIOD)

    assert len(pauses.ends) > STEPS
    times = [at - pauses.sent[0][0] for at, _ in pauses.sent]
    assert times == pytest.approx([n * PERIOD for n in range(len(times))], abs=0.001)


def test_node_that_pauses_inside_a_recipe_holds_up_no_recipe_of_others(simulation: Simulation) -> None:
    """RxPY keeps in a ``threading.local`` whether it runs something on this thread."""
    heard: list[float] = []

    def stand() -> None:
        rx.of(1).subscribe(lambda _: time.sleep(3.0))

    def go() -> None:
        time.sleep(1.0)
        rx.of(1).subscribe(lambda _: heard.append(simulation.now))

    for program in (stand, go):
        simulation.start(program, delay=Delay(0.0, 0.0))
    simulation.run(5.0)
    assert heard == pytest.approx([1.0], abs=0.001)
