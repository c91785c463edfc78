"""The kinds of faults of a simulated arm. Those of ``make chaos`` have the same names."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from rclpy_simulation import Delay, Process

from deploy.supervision.run_directory import KEY, with_parameters
from interfaces import topics
from tests.chaos import clock
from tests.chaos.faults import PARAMETERS, Undo
from tests.promises import marks
from tests.promises.history import (
    ALL,
    CONTROLLER,
    FALSE_PRESENCE,
    FUTURE_PRESENCE,
    HOLD,
    LOSE,
    NO_TARGET,
    OPERATOR,
    PARTITION,
    RIVAL,
    STUCK_DRIVE,
)
from tests.simulation import people
from tests.simulation.arm import CONTROL, NAMES, ROBOT, SimulatedArm

RIVAL_PAUSE = 0.22  # s: with it, a repeated `off` still comes within the 400 ms in which it is a veto
CLOCK_TOLERANCE = 0.045  # s between the clocks of the hosts (deploy/SAFETY.md, A3)
BAD_LINE = (0.2, Delay(0.05, 0.2))
"""Packet loss and latency of a bad line."""
STEPS = 40
"""The most clocks that a process reads, and messages that it publishes and takes, before a pause."""
HELD = (topics.OPERATOR_HEARTBEAT.name, topics.OPERATOR_PRESENCE.name)
"""The topics whose messages may be held."""


class FaultKind(NamedTuple):
    inject: Callable[[SimulatedArm, str, float], Undo | None]
    """Injects the fault into a target, for a duration; returns how to end it, or ``None``."""
    targets: tuple[str, ...]
    duration: tuple[float, float] = (0.0, 0.0)
    """The shortest and the longest duration [s]."""


def _process(act: Callable[[Process], Any]) -> Callable[[SimulatedArm, str, float], None]:
    """Return a fault that does something to the process of a program, if it has one."""

    def inject(arm: SimulatedArm, program: str, duration: float) -> None:
        if process := arm.process(program):
            act(process)

    return inject


def _stop(arm: SimulatedArm, program: str, duration: float) -> Undo | None:
    process = arm.process(program)
    if process is None:
        return None
    process.stop()
    return arm.nested.begin(("stop", process), process.proceed)


def _pause(arm: SimulatedArm, program: str, duration: float) -> Undo | None:
    """Stop a process inside a callback: between two readings of a clock, or before it publishes or takes."""
    process = arm.process(program)
    if process is None:
        return None
    process.stop_after(arm.simulation.random.randint(1, STEPS))

    def proceed() -> None:
        process.stop_after(0)
        process.proceed()

    return arm.nested.begin(("stop", process), proceed)


def _fail(error: type[BaseException]) -> Callable[[Process], None]:
    def fail() -> None:
        raise error("injected by the simulation")

    return lambda process: process.interrupt(fail)


def _slow(arm: SimulatedArm, program: str, duration: float) -> None:
    """Make a callback take long; DDS continues meanwhile."""
    if process := arm.process(program):
        process.interrupt(lambda: time.sleep(duration))


def _kill_all(arm: SimulatedArm, target: str, duration: float) -> None:
    for process in arm.processes():
        process.kill()


def _kill_supervisor(arm: SimulatedArm, target: str, duration: float) -> Undo:
    arm.supervisor.die()
    return arm.nested.begin("kill_supervisor", arm.start_again)


def _double(arm: SimulatedArm, program: str, duration: float) -> Undo:
    return arm.spawn(program, 1).kill


def _crash_loop(arm: SimulatedArm, program: str, duration: float) -> Undo:
    node = f"/{program}"
    given = {node: arm.given[node]} if node in arm.given else {}
    arm.parameters = with_parameters(arm.parameters, {node: {KEY: {PARAMETERS[program]: "not a number"}}})
    arm.write_parameters()
    if process := arm.process(program):
        process.kill()

    def repair() -> None:
        del arm.parameters[node]
        arm.parameters |= given
        arm.write_parameters()

    return arm.nested.begin(("crash_loop", program), repair)


def _stranger(program: Callable[[], None]) -> Callable[[SimulatedArm, str, float], Undo]:
    return lambda arm, target, duration: arm.simulation.start(program, name="stranger", host=ROBOT).kill


def _step_clock(arm: SimulatedArm, target: str, duration: float) -> None:
    """Set the time of day of both hosts, one after the other."""
    seconds = arm.simulation.random.uniform(-clock.LARGEST, clock.LARGEST)
    arm.simulation.host(ROBOT).step(seconds)
    pause = arm.simulation.random.uniform(0.0, marks.SPREAD)
    arm.simulation.after(pause, lambda: arm.simulation.host(CONTROL).step(seconds))


def _skew_clock(arm: SimulatedArm, target: str, duration: float) -> None:
    """Set the clock of the operator's host wrong, within the tolerance of assumption A3."""
    skew = arm.simulation.random.uniform(-CLOCK_TOLERANCE, CLOCK_TOLERANCE)
    arm.simulation.host(CONTROL).step(skew - arm.skew)
    arm.skew = skew


def _drift_clock(arm: SimulatedArm, target: str, duration: float) -> Undo:
    """Make the time of day of both hosts run at another rate."""
    rate = arm.simulation.random.uniform(-0.01, 0.01)

    def drift(rate: float) -> None:
        for name in (ROBOT, CONTROL):
            arm.simulation.set_drift(arm.simulation.host(name), rate)

    drift(rate)
    return arm.nested.begin("drift_clock", lambda: drift(0.0))


def _partition(arm: SimulatedArm, target: str, duration: float) -> Undo:
    arm.simulation.cut(ROBOT, CONTROL)
    return arm.nested.begin(PARTITION, lambda: arm.simulation.heal(ROBOT, CONTROL))


def _bad_line(arm: SimulatedArm, target: str, duration: float) -> Undo:
    network = arm.simulation.network
    network.loss, network.latency = BAD_LINE

    def heal() -> None:
        network.loss, network.latency = arm.good_line

    return arm.nested.begin("bad_line", heal)


def _lose(arm: SimulatedArm, topic: str, duration: float) -> None:
    arm.simulation.lose(f"rt/{topic}", duration)


def _rival(arm: SimulatedArm, target: str, duration: float) -> Undo:
    """Start a second controller on another host. It pauses, so that the first one is heard twice in a row."""
    process = arm.start_elsewhere(CONTROLLER, "rival")

    def pause() -> None:
        if process.exit_code is None:
            process.stop()
            arm.simulation.after(RIVAL_PAUSE, process.proceed)
            arm.simulation.after(3 * RIVAL_PAUSE, pause)

    arm.simulation.after(3 * RIVAL_PAUSE, pause)
    return process.kill


def _hold(arm: SimulatedArm, topic: str, duration: float) -> None:
    arm.simulation.hold(f"rt/{topic}", duration)


FAULT_KINDS: dict[str, FaultKind] = {
    "kill": FaultKind(_process(lambda it: it.kill()), NAMES),
    "terminate": FaultKind(_process(lambda it: it.send_signal(signal.SIGTERM)), NAMES),
    "stop": FaultKind(_stop, NAMES, (0.2, 15.0)),
    "pause": FaultKind(_pause, NAMES, (0.2, 3.0)),
    "hang": FaultKind(_process(lambda it: it.hang()), NAMES, (15.0, 15.0)),
    "slow": FaultKind(_slow, NAMES, (0.1, 2.0)),
    "raise": FaultKind(_process(_fail(RuntimeError)), NAMES),
    "hog": FaultKind(_process(_fail(MemoryError)), NAMES),
    "kill_all": FaultKind(_kill_all, (ALL,)),
    "kill_supervisor": FaultKind(_kill_supervisor, (ALL,), (0.5, 5.0)),
    "double": FaultKind(_double, NAMES, (6.0, 8.0)),
    "crash_loop": FaultKind(_crash_loop, tuple(each for each in PARAMETERS if each in NAMES), (3.0, 6.0)),
    "flood": FaultKind(_stranger(people.flood), (NO_TARGET,), (3.0, 6.0)),
    "babble": FaultKind(_stranger(people.babble), (NO_TARGET,), (3.0, 10.0)),
    marks.STEP: FaultKind(_step_clock, (NO_TARGET,)),
    "skew_clock": FaultKind(_skew_clock, (OPERATOR,)),
    "drift_clock": FaultKind(_drift_clock, (NO_TARGET,), (5.0, 60.0)),
    PARTITION: FaultKind(_partition, (OPERATOR,), (0.5, 20.0)),
    "bad_line": FaultKind(_bad_line, (ALL,), (1.0, 5.0)),
}
"""The random faults of a simulated arm."""

ATTACK_KINDS: dict[str, FaultKind] = {
    HOLD: FaultKind(_hold, HELD),
    FALSE_PRESENCE: FaultKind(_stranger(people.pretend), (NO_TARGET,)),
    LOSE: FaultKind(_lose, (topics.ENGINES.name,)),
    FUTURE_PRESENCE: FaultKind(_stranger(people.foretell), (NO_TARGET,)),
    RIVAL: FaultKind(_rival, (NO_TARGET,)),
    STUCK_DRIVE: FaultKind(
        lambda arm, target, duration: None, (NO_TARGET,)
    ),  # the checkers take it from the record
}
"""Faults that only an attack injects (:mod:`tests.simulation.attacks`)."""
