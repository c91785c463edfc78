"""Listing 5.9 of the thesis: its inputs give its output through all recipes, line by line."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import reactivex as rx
from reactivex import Observable
from reactivex.scheduler import VirtualTimeScheduler
from reactivex.subject import Subject
from reactivex.testing import TestScheduler

from deploy.operator.lines import Line, line_batches
from interfaces import cause, topics
from interfaces.explanation import engine_causes
from interfaces.latch import Command, Presence
from interfaces.sources import playback, scenario_file
from interfaces.topics import Position
from reactive_node import stamps
from services.engine_controller import engine_state, turns
from services.kinematics import effector_position
from services.operator_watchdog import engine_commands, operator_activity
from services.velocity import effector_speed

SCENARIO = Path(__file__).parents[2] / "deploy" / "scenarios" / "listing_5_9.yaml"
ORIGIN = datetime(1970, 1, 1, tzinfo=UTC)
START = 0.005  # [s]: the terminal is there before the services
WATCH_BEGINS = 0.010  # [s]: the thesis' samples fall on 2010, 2510, 4510 ms

# As printed in the thesis, except for the delays of its program: in the first line (1941), in two of the
# watchdog (10512, 13513), and in the position printed at 4243, which the next speed dates to 4244.
LISTING = """
[1942] ### Received new data: {2, 3, 0.785398, 0.785398}
[1942] Position x: 1.41421 and y: 4.41421
[1942] ### Received signal from operator
[1991] ### Received signal from operator
[2010] Operator is alive
[2041] ### Received signal from operator
[2091] ### Received signal from operator
[2141] ### Received signal from operator
[2192] ### Received signal from operator
[2242] ### Received signal from operator
[2292] ### Received signal from operator
[2342] ### Received signal from operator
[2392] ### Received signal from operator
[2510] Operator is alive
[3443] ### Received new data: {2, 3, 1.91986, 0.785398}
[3443] Position x: -3.40296 and y: 3.14725
[3443] Speed: 3.31845 [m/s]
[3943] ### Received new data: {2, 3, 1.91986, 1.7854}
[3943] Position x: -3.21994 and y: 0.276522
[3943] Speed: 5.75311 [m/s]
[4143] ### Received new data: {2, 3, 1.91986, 1.7854}
[4143] Position x: -3.21994 and y: 0.276522
[4143] Speed: 0 [m/s]
[4244] ### Received new data: {2, 3, 1.91986, 1.7854}
[4244] Position x: -3.21994 and y: 0.276522
[4444] ### Received new data: {2, 3, 1.5708, 1.7854}
[4444] Position x: -2.93119 and y: 1.36111
[4444] Speed: 5.61186 [m/s]
[4444] ### Received signal from operator
[4510] Operator is alive
[6444] ### Received new data: {2, 3, 2.35619, 1.7854}
[6444] Position x: -3.03513 and y: -1.11019
[6444] Speed: 1.23674 [m/s]
[7510] Not received signal from operator...
[10510] Not received signal from operator...
[13510] Not received signal from operator...
[13510] Operator is sleeping !!!
[13510] Turning off engines...
""".strip().splitlines()


class Arm:
    def __init__(self, path: Path) -> None:
        self.scheduler = TestScheduler()
        self.topics: dict[str, Subject[Any]] = {topic.name: Subject() for topic in topics.CONTRACT}
        self.lines: list[str] = []
        played = scenario_file.load(path)
        batches = line_batches(self.seen, rx.interval(0.1))
        batches.subscribe(self.print, scheduler=self.scheduler)
        self.scheduler.advance_to(START)
        self.wire()
        for name, timeline in played.configuration.items():
            self.publish(name, playback.state(timeline, START))
        assert played.heartbeats is not None
        self.publish("operator_heartbeat", playback.events(played.heartbeats, START))

    def seen(self, topic: topics.Topic) -> Observable[Any]:
        return self.topics[topic.name].timestamp(scheduler=self.scheduler)

    def publish(self, name: str, values: Observable[Any]) -> None:
        values.subscribe(self.topics[name].on_next, scheduler=self.scheduler)

    def print(self, lines: list[Line]) -> None:
        for line in lines:
            self.lines.append(f"[{(line.time - ORIGIN) / timedelta(milliseconds=1):.0f}] {line.text}")

    def wire(self) -> None:
        configuration = [self.topics[name] for name in topics.CONFIGURATION]
        self.publish("effector/position", effector_position(*configuration).map(self.position))
        self.publish("effector/speed", effector_speed(self.topics["effector/position"]))

        heartbeats = self.seen(topics.OPERATOR_HEARTBEAT)
        begin = rx.timer(WATCH_BEGINS - START)
        activity = begin.flat_map(lambda _: operator_activity(heartbeats)).share()
        alive = activity.filter(lambda it: it.conclusion == topics.ALIVE)
        self.publish("operator_presence", alive.map(lambda it: it.seen))
        self.publish("operator_activity", activity.map(lambda it: it.conclusion))
        self.publish("engines", engine_commands(activity))

        commands = self.topics["engines"].map(lambda it: Command(self.scheduler.now, 0.0, it))
        presences = self.topics["operator_presence"].map(
            lambda it: Presence(self.scheduler.now, self.age(it))
        )
        latched = turns(commands, presences).share()
        self.publish("engines/state", engine_state(latched))
        self.publish("engines/cause", engine_causes(latched, rx.never()).map(cause.message))

    def age(self, stamp: datetime) -> float:
        return (self.scheduler.now - stamp).total_seconds()

    def position(self, position: tuple[float, float]) -> Position:
        now = VirtualTimeScheduler.to_datetime(self.scheduler.clock)
        return Position(stamps.to_nanoseconds(now), *position)


def test_inputs_of_the_listing_give_its_lines_and_no_engines_run() -> None:
    arm = Arm(SCENARIO)

    arm.scheduler.advance_to(20.0)

    states = [line for line in arm.lines if "Engines are" in line]
    assert [line for line in arm.lines if line not in states] == LISTING
    assert [line.partition("] ")[2] for line in states] == [
        "Engines are off, not turned on since engine_controller started"
    ]
