"""Signals: whether they answer, how exact they are, what they cost, and the speed of a real arm."""

from __future__ import annotations

import hashlib
import math
import os
import random
import struct
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path
from typing import Any

import rclpy
import yaml
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from reactivex.disposable import Disposable
from reactivex.subject import Subject

from deploy.supervision import interruption
from deploy.supervision.environment import NAMESPACE, set_middleware
from interfaces.robot_model import forward_kinematics
from interfaces.sources.scenario_file import load
from interfaces.topics import EFFECTOR_SPEED, EFFECTOR_TWIST, THETA1, THETA2
from reactive_node.signals import Answer, Refused, Signal, as_taken, lift, linear
from reactive_node.stamps import from_nanoseconds, stamped
from reactive_node.testing import VirtualTime
from tests.benchmarks.scale import Fleet

MIX, LINE, SPEED, HOUR, COST, DAY = (
    "50 Hz and 60 Hz, jitter 5 ms, one in fifty 80 ms late, lateness 100 ms",
    "linear motion, interpolated",
    "speed of the effector in the demo, live",
    "an hour with disordered input",
    "a sample through linear, lift of four, derivative, sample",
    "24 simulated hours",
)
LATENESS, GAP = 0.1, 0.1  # s
LINK1, LINK2 = 2.0, 3.0  # m, of the demo
SECONDS = 60.0  # s of the live measurement
NS = 1_000_000_000
DEMO = Path(__file__).parents[2] / "deploy" / "scenarios" / "demo.yaml"

Row = tuple[str, str, str, str]
"""What was measured, the goal, the result, and what else was seen."""
Arrivals = list[tuple[float, Any]]
"""Samples with the times of their arrival [s]."""


def measure() -> Iterator[Row]:
    """Yield all rows of the table, and print each."""
    for row in (mix, line, hour, cost, day, speed):
        interruption.check()
        found = row()
        print(" | ".join(found), flush=True)
        yield found


def table(results: Mapping[str, Sequence[str]]) -> str:
    """Return the rows as a table, by what was measured."""
    head = "| | goal | measured | notes |\n|---|---|---|---|"
    return "\n".join([head, *(f"| {' | '.join((name, *row))} |" for name, row in results.items())])


def arrivals(
    rate: float, seconds: float, value: Callable[[float], Any], seed: int, late: float = 0.08
) -> Arrivals:
    """Return samples with a jitter of 5 ms, one in fifty late [s], in the order of their arrival."""
    chance = random.Random(seed)
    times = [k / rate for k in range(1, round(seconds * rate))]
    delays = (late if chance.random() < 1 / 50 else chance.uniform(0.0, 0.005) for _ in times)
    return sorted(
        (t + delay, stamped(value(t), round(t * NS))) for t, delay in zip(times, delays, strict=True)
    )


def mix(seconds: float = 600.0) -> Row:
    """Ask for values of two topics at common times."""
    scheduler = VirtualTime()
    one, other = (
        linear(scheduler.hot(*arrivals(rate, seconds, math.sin, seed=1)), lateness=LATENESS, gap=GAP)
        for rate in (50.0, 60.0)
    )
    pairs = lift(lambda *values: values)(one, other).sample(0.02)
    asked = [(at, it) for at, it in scheduler.record(pairs, until=seconds).items if it.time / NS >= 0.1]
    answered = sum(answer.is_certain for _, answer in asked) / len(asked)
    waited = sorted(at - answer.time / NS for at, answer in asked)
    latency = f"latency p50 {1000 * _quantile(waited, 0.5):.0f} ms, longest {1000 * waited[-1]:.0f} ms"
    return MIX, "100 % answered", f"{answered:.1%}", f"{latency}, of {len(asked)} questions"


def line(seconds: float = 60.0) -> Row:
    """Compare interpolated values with those of a straight movement."""
    scheduler = VirtualTime()
    samples = scheduler.hot(*arrivals(50.0, seconds, lambda t: 3.0 - 2.0 * t, seed=1))
    answers = scheduler.record(linear(samples, lateness=LATENESS, gap=GAP).sample(0.001), until=seconds).items
    errors = [abs(it.value - (3.0 - 2.0 * it.time / NS)) for _, it in answers if it.is_certain]
    return LINE, "exact to 1e-9", f"{max(errors):.0e}", f"{len(errors)} values"


def effector(
    topics: Sequence[Any], refused: Callable[[Refused], None] | None = None, lateness: float = LATENESS
) -> Signal[Any]:
    """Return the velocity of the effector."""
    states = (linear(each, lateness=lateness, gap=GAP, refused=refused) for each in topics)
    return lift(forward_kinematics)(*states).derivative(over=GAP)


def hour(seconds: float = 3600.0) -> Row:
    """Compare the bytes of the answers for input in order, out of order, and in a replay of late input."""
    values = [lambda t, k=k: 2.0 + math.sin(t / (k + 1)) for k in range(4)]

    def answered(
        arriving: Sequence[Arrivals], late: Sequence[Refused] = (), lateness: float = LATENESS
    ) -> tuple[str, list[Refused]]:
        scheduler, digest = VirtualTime(), hashlib.sha256()
        refused: list[Refused] = []
        inputs = [as_taken(scheduler.hot(*each), late) for each in arriving]

        def add(answer: Answer[tuple[float, float]]) -> None:
            if answer.is_certain and answer.time < (seconds - 2.0) * NS:
                digest.update(struct.pack("<qdd", answer.time, *answer.value))

        effector(inputs, refused.append, lateness).sample(0.02).subscribe(add, scheduler=scheduler)
        scheduler.advance_to(seconds)
        return digest.hexdigest(), refused

    ordered, disordered, late = (
        [arrivals(10.0, seconds, value, seed=k, late=delay) for k, value in enumerate(values)]
        for delay in (0.005, 0.08, 0.15)
    )
    one, _ = answered(ordered)
    other, refused = answered(disordered)
    live, dropped = answered(late)
    replayed, _ = answered(ordered, dropped, lateness=0.5)
    same = one == other and live == replayed and not refused
    more = f"with {len(dropped)} samples later than their bound, the replay has the bytes of the run"
    return HOUR, "the same bytes", "the same" if same else "DIFFERENT", more


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


def feed(samples: int, rate: float = 50.0) -> Iterator[int]:
    """Send samples of four topics through the whole chain; yield how many there were."""
    clock, topics = Clock(), [Subject[Any]() for _ in range(4)]
    effector(topics).sample(1 / rate).subscribe(lambda _: None, scheduler=clock)
    step = round(NS / rate / 4)
    for k in range(samples):
        clock.time = k * step
        topics[k % 4].on_next(stamped(1.0, clock.time))
        yield k


def cost(samples: int = 100_000) -> Row:
    """Measure the processor time of a sample; every fourth one gives an answer."""
    began = time.process_time()
    for _ in feed(samples):
        pass
    micros = (time.process_time() - began) / samples * 1e6
    return COST, "≤ 20 µs", f"{micros:.1f} µs", "one answer for four samples"


def day(hours: int = 24, rate: float = 10.0) -> Row:
    """Measure the memory over a day."""
    in_an_hour = round(4 * 3600 * rate)
    sizes = [_resident() for k in feed(hours * in_an_hour, rate) if k % in_an_hour == in_an_hour - 1]
    growth = (sizes[-1] - sizes[0]) / 1e6
    return (
        DAY,
        "flat",
        f"{growth:+.1f} MB",
        f"{sizes[-1] / 1e6:.0f} MB after a day, {hours * in_an_hour:,} samples",
    )


def speed(seconds: float = SECONDS) -> Row:
    """Run the demo with real processes, and compare its speeds with those of the scenario."""
    velocities: list[tuple[float, float]] = []  # the time for which it is true [s], and the speed
    speeds: list[tuple[float, float]] = []
    with tempfile.TemporaryDirectory(prefix="signals-") as directory, ExitStack() as stack:
        # Without the drive, the joints follow the scenario from its origin on.
        moving = {name: part for name, part in yaml.safe_load(DEMO.read_text()).items() if name != "drive"}
        scenario = Path(directory, "moving.yaml")
        scenario.write_text(yaml.safe_dump(moving))
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


def _resident() -> int:
    """Return the memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


_SCENARIO: Mapping[str, Any] = load(DEMO).configuration
