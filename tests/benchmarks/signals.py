"""Signals: what they cost, and how exact the speed of a real arm is.

That they answer, are exact and need no memory shows in the tests of reactive_node.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import Any

import rclpy
import ros_yaml
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from reactivex.disposable import Disposable
from reactivex.subject import Subject

from deploy.supervision import interruption
from deploy.supervision.environment import NAMESPACE, set_middleware
from interfaces.robot_model import forward_kinematics
from interfaces.sources.scenario_file import load
from interfaces.topics import EFFECTOR_SPEED, EFFECTOR_TWIST, THETA1, THETA2
from reactive_node.signals import Signal, lift, linear
from reactive_node.stamps import from_nanoseconds, stamped
from reactive_node.testing import VirtualTime
from tests.benchmarks.scale import Fleet

SPEED = "speed of the effector in the demo, live"
COST = "a sample through linear, lift of four, derivative, sample"
LATENESS, GAP = 0.1, 0.1  # s
RATE = 50.0  # Hz of the answers
LINK1, LINK2 = 2.0, 3.0  # m, of the demo
SECONDS = 60.0  # s of the live measurement
NS = 1_000_000_000
DEMO = Path(__file__).parents[2] / "deploy" / "scenarios" / "demo.yaml"

Row = tuple[str, str, str, str]
"""What was measured, the goal, the result, and what else was seen."""


def measure() -> Iterator[Row]:
    """Yield all rows of the table, and print each."""
    for row in (cost, speed):
        interruption.check()
        found = row()
        print(" | ".join(found), flush=True)
        yield found


def table(results: Mapping[str, Sequence[str]]) -> str:
    """Return the rows as a table, by what was measured."""
    head = "| | goal | measured | notes |\n|---|---|---|---|"
    return "\n".join([head, *(f"| {' | '.join((name, *row))} |" for name, row in results.items())])


def effector(topics: Sequence[Any]) -> Signal[Any]:
    """Return the velocity of the effector."""
    states = (linear(each, lateness=LATENESS, gap=GAP) for each in topics)
    return lift(forward_kinematics)(*states).derivative(over=GAP)


class Clock(VirtualTime):
    """A clock that is set by hand; nothing waits for it."""

    time = 0  # ns

    @property
    def now(self) -> datetime:
        """The present time."""
        return from_nanoseconds(self.time)

    def schedule_relative(self, *_: Any, **__: Any) -> Any:
        """Do nothing: samples come all the time."""
        return Disposable()


def cost(samples: int = 100_000) -> Row:
    """Measure the processor time of a sample; every fourth one gives an answer."""
    clock, topics = Clock(), [Subject[Any]() for _ in range(4)]
    effector(topics).sample(1 / RATE).subscribe(lambda _: None, scheduler=clock)
    step = round(NS / RATE / 4)
    began = time.process_time()
    for k in range(samples):
        clock.time = k * step
        topics[k % 4].on_next(stamped(1.0, clock.time))
    micros = (time.process_time() - began) / samples * 1e6
    return COST, "≤ 20 µs", f"{micros:.1f} µs", "one answer for four samples"


def speed(seconds: float = SECONDS) -> Row:
    """Run the demo with real processes, and compare its speeds with those of the scenario."""
    velocities: list[tuple[float, float]] = []  # the time for which it is true [s], and the speed
    speeds: list[tuple[float, float]] = []
    with tempfile.TemporaryDirectory(prefix="signals-") as directory, ExitStack() as stack:
        # Without the drive, the joints follow the scenario from its origin on.
        moving = {name: part for name, part in ros_yaml.read(DEMO).items() if name != "drive"}
        scenario = Path(directory, "moving.yaml")
        scenario.write_text(ros_yaml.dump(moving))
        fleet = stack.enter_context(Fleet(Path(directory), shared=True, scenario=str(scenario)))
        fleet.start()
        (arm,) = fleet.arms
        context = rclpy.Context()
        os.environ[NAMESPACE] = arm.namespace
        set_middleware(os.environ)  # which keeps the arms of a domain apart
        rclpy.init(context=context, domain_id=fleet.domain, signal_handler_options=SignalHandlerOptions.NO)
        node = Node("benchmark", context=context, namespace=arm.namespace)

        def moved(message: Any) -> None:
            stamp, linear = message.header.stamp, message.twist.linear
            velocities.append((stamp.sec + stamp.nanosec / NS, math.hypot(linear.x, linear.y)))

        for topic, heard in (
            (EFFECTOR_TWIST, moved),
            (EFFECTOR_SPEED, lambda message: speeds.append((time.time(), message.data))),
        ):
            node.create_subscription(topic.type, topic.name, heard, topic.qos)
        executor = rclpy.executors.SingleThreadedExecutor(context=context)
        executor.add_node(node)
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            interruption.check()
            executor.spin_once(timeout_sec=0.1)
        origin = arm.system.origin() + time.time() - time.monotonic()
        node.destroy_node()
        context.try_shutdown()
    peak = max(true_speed(k / 100) for k in range(2000))
    new, old = (_errors(found, origin, peak) for found in (velocities, speeds))
    more = (
        f"p50 {_quantile(new, 0.5):.2%}, largest {new[-1]:.2%} of {peak:.2f} m/s, {len(new)} values; "
        f"the thesis' recipe: p50 {_quantile(old, 0.5):.2%}, p99 {_quantile(old, 0.99):.2%}, "
        f"largest {old[-1]:.2%}"
    )
    return SPEED, "p99 ≤ 1 % of the peak", f"{_quantile(new, 0.99):.2%}", more


def true_speed(at: float) -> float:
    """Return the speed of the effector in the demo [m/s], so many seconds after its origin."""
    joints = [_SCENARIO[topic.name] for topic in (THETA1, THETA2)]
    before, after = (
        forward_kinematics(LINK1, LINK2, *(joint.at(at + d) for joint in joints)) for d in (-1e-4, 1e-4)
    )
    return math.dist(before, after) / 2e-4


def _errors(found: Sequence[tuple[float, float]], origin: float, peak: float) -> list[float]:
    """Return the errors of speeds in relation to the peak, in their order."""
    return sorted(abs(value - true_speed(at - origin)) / peak for at, value in found)


def _quantile(ordered: Sequence[float], part: float) -> float:
    return ordered[min(len(ordered) - 1, math.ceil(part * len(ordered)) - 1)]


_SCENARIO: Mapping[str, Any] = load(DEMO).configuration
