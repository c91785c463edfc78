"""Replays recorded messages to unmodified services, in virtual time."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from heapq import merge
from pathlib import Path
from typing import Any

from rclpy_simulation import Process, Simulation
from rclpy_simulation.host import BOOT, SECOND
from rclpy_simulation.replay.lives import Run, live
from rclpy_simulation.replay.player import AT_ONCE, Offer, Player, constant_network

from deploy.supervision import manifest
from deploy.supervision.environment import NAMESPACE
from interfaces.service.epoch import EPOCH
from interfaces.topics import DIAGNOSTICS, Topic
from tests.promises.history import WATCHDOG
from tests.replay import chains
from tests.replay.chains import Chain
from tests.replay.lives import AHEAD, ReplayedLife, lives, origin
from tests.replay.record import Message, Record
from tests.simulation.arm import ROBOT
from tests.simulation.machine import simulated_services
from tests.simulation.viewer import view

LEAD = 2 * SECOND  # ns from the beginning of the simulation to that of the record or of a process


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
    player = _Player(record, namespace, chain)
    with simulated_services("replay", constant_network(), epoch=player.boot) as simulation:
        for service in chain:
            player.start(simulation, service, parameters)
        player.hear(simulation, chain)
        environment = {NAMESPACE: namespace}
        simulation.start(view, name="viewer", host=ROBOT, environment=environment, delay=AT_ONCE)
        player.feed(
            simulation, [*chains.inputs(record, namespace, chain), *chains.past(record, namespace, chain)]
        )
        simulation.run((record.end - player.boot) / SECOND)
        return player.result


class _Player:
    def __init__(self, record: Record, namespace: str, chain: Chain) -> None:
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
        self._record = record
        self._namespace = namespace
        self.boot = min(record.begin, earliest) - LEAD
        """The time of day at the beginning of the simulation [ns since 1970]."""

    # The services

    def start(self, simulation: Simulation, service: str, parameters: Path | None) -> None:
        module = next(each.module for each in manifest.programs() if each.name == service)
        arguments = ["--params-file", str(parameters)] if parameters else []
        if service == WATCHDOG:
            epoch = (BOOT + self._origin - self.boot) / SECOND
            arguments += ["-p", f"{EPOCH}:={epoch:.9f}"]
        for each in self.result.lives[service]:
            values = each.parameters.items()  # JSON is YAML, as `-p` wants it
            recorded = [word for name, value in values for word in ("-p", f"{name}:={json.dumps(value)}")]
            words = ["--ros-args", *recorded, *arguments]  # a user's file comes later, and wins
            run = Run(module, words, ROBOT, each.began, each.ended, each.suspensions, service)
            live(simulation, run, {NAMESPACE: self._namespace}, self.boot, self._started)

    def _started(self, process: Process) -> None:
        process.at_end(lambda: self._note_end(process))

    def _note_end(self, process: Process) -> None:
        if process.exit_code is not None and process.exit_code >= 0:
            lines = process.output.text.strip().splitlines()
            reason = lines[-1] if lines else f"exit code {process.exit_code}"
            now = self.boot + process.kernel.now - BOOT
            self.result.failures.append((now, f"{process.name} ended: {reason}"))

    # The messages

    def hear(self, simulation: Simulation, chain: Chain) -> None:
        made = [*chains.outputs(chain), DIAGNOSTICS]
        kept = self.result.messages = {topic.name: [] for topic in made}
        heard = {f"rt{topic.full_name(self._namespace)}": kept[topic.name] for topic in made}

        def note(writer: Any, sample: Any) -> None:
            messages = heard.get(writer.topic)
            is_made_up = sample.source_timestamp < self._record.begin
            if messages is not None and not is_made_up and writer.participant.process.name in chain:
                messages.append(Message(sample.source_timestamp, sample.data))

        simulation.tap(note)

    def feed(self, simulation: Simulation, inputs: list[tuple[Topic, list[Message]]]) -> None:
        """Publish recorded messages at their times, as one node that is no part of the arm."""
        offers = {topic.full_name(self._namespace): Offer(topic.type, topic.qos) for topic, _ in inputs}
        begin, boot = self._record.begin, self.boot - BOOT
        streams = [
            [(max(sent, begin) - boot, topic.full_name(self._namespace), data) for sent, data in messages]
            for topic, messages in inputs
        ]
        following = merge(*streams, key=lambda message: message[0])
        Player(simulation, offers, lambda: following, frozenset(offers), ROBOT)
