"""Replays recorded messages to unmodified services, in virtual time."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from heapq import merge
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from rclpy_simulation import Delay, Network, Process, Simulation
from rclpy_simulation.host import BOOT, SECOND

from deploy.supervision import manifest
from deploy.supervision.environment import NAMESPACE
from interfaces.service.epoch import EPOCH
from interfaces.topics import DIAGNOSTICS, Topic
from tests.promises.history import WATCHDOG
from tests.replay import chains
from tests.replay.chains import Chain
from tests.replay.lives import AHEAD, ReplayedLife, Suspension, lives, origin
from tests.replay.record import Message, Record
from tests.simulation.arm import ROBOT
from tests.simulation.machine import simulated_services
from tests.simulation.viewer import view

LEAD = 2 * SECOND  # ns from the beginning of the simulation to that of the record or of a process
NETWORK = Network(latency=Delay(0.0002, 0.0002), discovery=Delay(0.01, 0.01), matching=Delay(0.002, 0.002))
"""As on an idle machine, without chance."""


@dataclass
class Playback:
    messages: dict[str, list[Message]] = field(default_factory=dict)
    """By topic name of the contract, in the order of sending; with the health."""
    lives: dict[str, list[ReplayedLife]] = field(default_factory=dict)
    """By service."""
    failures: list[tuple[int, str]] = field(default_factory=list)
    """When a service ended by itself [ns since 1970], and its last words."""


def replay(record: Record, namespace: str, chain: Chain, parameters: Path | None = None) -> Playback:
    """Replay a record to the services of a chain, with a ROS parameter file if there is one."""
    with simulated_services("replay", NETWORK) as simulation:
        player = _Player(simulation, record, namespace, chain)
        for service in chain:
            player.start(service, parameters)
        player.hear(chain)
        environment = {NAMESPACE: namespace}
        simulation.start(view, name="viewer", host=ROBOT, environment=environment, delay=Delay(0.0, 0.0))
        player.feed([*chains.inputs(record, namespace, chain), *chains.past(record, namespace, chain)])
        simulation.run((record.end - player.boot) / SECOND)
        return player.result


class _Player:
    def __init__(self, simulation: Simulation, record: Record, namespace: str, chain: Chain) -> None:
        self.result = Playback(lives={service: lives(record, namespace, service) for service in chain})
        self._origin = record.begin
        """When the watchdog begins to expect the operator [ns since 1970]."""
        if WATCHDOG in chain:
            first, *others = self.result.lives[WATCHDOG]
            self._origin = origin(record, namespace, first)
            if first.has_past:
                first = first._replace(began=min(first.began, self._origin - AHEAD))
            self.result.lives[WATCHDOG] = [first, *others]
        earliest = min(each[0].began for each in self.result.lives.values())
        self._simulation = simulation
        self._record = record
        self._namespace = namespace
        host = simulation.host(ROBOT)
        host.step((min(record.begin, earliest) - LEAD - host.time_of_day(BOOT)) / SECOND)
        self.boot = host.time_of_day(BOOT)
        """The time of day at the beginning of the simulation [ns since 1970]."""

    def _at(self, time: int, action: Callable[[], Any]) -> None:
        """Run an action at a time of day [ns since 1970], exactly."""
        self._simulation.at((max(time - self.boot, 0) + 0.5) / SECOND, action)

    # The services

    def start(self, service: str, parameters: Path | None) -> None:
        module = next(each.module for each in manifest.programs() if each.name == service)
        arguments = ["--params-file", str(parameters)] if parameters else []
        if service == WATCHDOG:
            epoch = (BOOT + self._origin - self.boot) / SECOND
            arguments += ["-p", f"{EPOCH}:={epoch:.9f}"]
        for life in self.result.lives[service]:
            self._at(life.began, partial(self._begin, service, module, arguments, life))

    def _begin(self, service: str, module: str, arguments: list[str], life: ReplayedLife) -> None:
        parameters = life.parameters.items()  # JSON is YAML, as `-p` wants it
        recorded = [word for name, value in parameters for word in ("-p", f"{name}:={json.dumps(value)}")]
        process = self._simulation.start(
            module,
            "--ros-args",
            *recorded,  # a user's file comes later, and wins
            *arguments,
            host=ROBOT,
            environment={NAMESPACE: self._namespace},
            name=service,
            delay=Delay(0.0, 0.0),
        )
        process.at_end(lambda: self._note_end(process))
        if life.ended is not None:
            self._at(life.ended, process.kill)
        for suspension in life.suspensions:
            self._suspend(process, suspension)

    def _suspend(self, process: Process, suspension: Suspension) -> None:
        kind, begin, end = suspension
        if kind == "stop":
            self._at(begin, process.stop)
            self._at(end, process.proceed)
        else:
            self._at(begin, lambda: process.interrupt(lambda: time.sleep((end - begin) / SECOND)))

    def _note_end(self, process: Process) -> None:
        if process.exit_code is not None and process.exit_code >= 0:
            lines = process.output.text.strip().splitlines()
            reason = lines[-1] if lines else f"exit code {process.exit_code}"
            now = self.boot + round(self._simulation.now * SECOND)
            self.result.failures.append((now, f"{process.name} ended: {reason}"))

    # The messages

    def hear(self, chain: Chain) -> None:
        made = [*chains.outputs(chain), DIAGNOSTICS]
        kept = self.result.messages = {topic.name: [] for topic in made}
        heard = {f"rt{topic.full_name(self._namespace)}": kept[topic.name] for topic in made}

        def note(writer: Any, sample: Any) -> None:
            messages = heard.get(writer.topic)
            is_made_up = sample.source_timestamp < self._record.begin
            if messages is not None and not is_made_up and writer.participant.process.name in chain:
                messages.append(Message(sample.source_timestamp, sample.data))

        self._simulation.tap(note)

    def feed(self, inputs: list[tuple[Topic, list[Message]]]) -> None:
        """Publish recorded messages at their times, as one node that is no part of the arm."""
        publishers: list[Publisher] = []

        def publish_for_ever() -> None:
            rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
            node = Node("replay", namespace=self._namespace)
            for topic, _ in inputs:
                publishers.append(node.create_publisher(topic.type, topic.name, topic.qos))
            rclpy.spin(node)

        player = self._simulation.start(publish_for_ever, name="replay", host=ROBOT, delay=Delay(0.0, 0.0))
        begin = self._record.begin
        streams = [
            [(max(sent, begin), number, data) for sent, data in messages]
            for number, (_, messages) in enumerate(inputs)
        ]
        following = merge(*streams, key=lambda item: item[:2])
        self._publish(following, player, publishers)

    def _publish(self, following: Iterator[Any], player: Process, publishers: list[Publisher]) -> None:
        upcoming = next(following, None)
        if upcoming is None:
            return
        sent, number, data = upcoming

        def publish() -> None:
            player.interrupt(lambda: publishers[number].publish(data))
            self._publish(following, player, publishers)

        self._at(sent, publish)
