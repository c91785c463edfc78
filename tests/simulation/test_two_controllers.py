"""Two controllers of one arm, as after a start on two hosts that were cut from each other, in virtual time.

Here run whole processes; tests/component/test_two_controllers.py has their recipes, for many more hours.
"""

from __future__ import annotations

import itertools
import random
import tempfile
from bisect import bisect
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from rclpy_simulation import Network, Process
from rclpy_simulation.host import BOOT, SECOND
from rclpy_simulation.process import running_process

from deploy.supervision.run_directory import scenario_parameters
from interfaces import topics
from interfaces.topics import DRIVE_TIMEOUT, OFF, ON
from tests.promises.history import CONTROLLER, DRIVE, SWITCH, WATCHDOG
from tests.promises.observations import values
from tests.simulation import arm
from tests.simulation.arm import CONTROL, ROBOT
from tests.simulation.bugs import Bug, planted
from tests.simulation.calibration import load
from tests.simulation.machine import simulated_services

LENGTH = 120.0  # s of an experiment
KNOWN = 20.0  # s after a cut until both hosts surely know each other again
WAY = 0.05  # s of a message at most, and of the drive's period
AWAY = 0.3  # s of a killed program
NEW = 1.0  # s of a new controller until the drive surely knows it
PROGRAMS = {ROBOT: (WATCHDOG, CONTROLLER, DRIVE), CONTROL: (WATCHDOG, CONTROLLER, SWITCH)}
NO_VETO = Bug(DRIVE, "unopposed(states)", "states")


class Fight(NamedTuple):
    contradictions: int
    """How many states of a controller contradicted the other one that the drive heard."""
    moved: float
    """For how long the drive moved the joints [s]."""
    against: list[float]
    """When it moved them while a controller that it heard said `off`."""


def scenario(chance: random.Random) -> dict[str, Any]:
    """Return an operator who lets go now and then, and commands the engines again and again."""
    pressed, time = [], 0.0
    while time < LENGTH:
        held = chance.uniform(10.0, 40.0)
        pressed.append({"from": time, "to": time + held})
        time += held + chance.uniform(0.5, 15.0)
    commands = [
        {"at": at + chance.uniform(0.0, 3.0), "command": chance.choice(["turn_on", "turn_on", "turn_off"])}
        for at in range(2, int(LENGTH), 5)
    ]
    track = {"center": 0.0, "amplitude": 1.0, "period": 8.0}
    return {"theta1": track, "drive": {}, "operator": {"pressed": pressed}, "engines": commands}


def fight(seed: str) -> Fight:
    """Run two controllers of one drive, while the line between their hosts is cut and heals."""
    chance = random.Random(f"two controllers {seed}")
    given = load()
    states: dict[str, list[tuple[float, str]]] = defaultdict(list)
    starts: dict[str, list[float]] = defaultdict(list)
    times: list[tuple[float, float]] = []
    cuts: list[tuple[float, float]] = []
    with (
        tempfile.TemporaryDirectory() as directory,
        simulated_services(seed, Network(latency=given.latency, discovery=given.discovery)) as simulation,
    ):
        file, parameters = Path(directory, "scenario.yaml"), Path(directory, "parameters.yaml")
        file.write_text(yaml.safe_dump(scenario(chance)))
        shared = scenario_parameters(file, BOOT / SECOND + 1.0, Path(directory, "settings"))
        parameters.write_text(yaml.safe_dump(shared))

        modules = {program.name: program.module for program in arm.PROGRAMS}

        def start(host: str, program: str) -> None:
            arguments = ("--ros-args", "--params-file", str(parameters))
            process = simulation.start(modules[program], *arguments, host=host, delay=given.start_up)
            process.at_end(lambda: simulation.after(AWAY, lambda: start(host, program)))
            processes[host, program] = process
            if program == CONTROLLER:
                starts[host].append(simulation.now)

        def note(writer: Any, sample: Any) -> None:
            if writer.topic == "rt/engines/state":
                (value,) = values(topics.ENGINES_STATE, sample.data, "/")
                states[running_process().host.name].append((simulation.now, value))
            elif writer.topic == "rt/driven_time":
                ((value, _),) = values(topics.DRIVEN_TIME, sample.data, "/")
                times.append((simulation.now, value))

        processes: dict[tuple[str, str], Process] = {}
        simulation.tap(note)
        for host, programs in PROGRAMS.items():
            for program in programs:
                start(host, program)
        at = 5.0
        while at < LENGTH:
            end = at + chance.choice([0.2, 1.0, 5.0, 11.0]) * chance.uniform(0.5, 1.5)
            simulation.at(at, lambda: simulation.cut(ROBOT, CONTROL))
            simulation.at(end, lambda: simulation.heal(ROBOT, CONTROL))
            cuts.append((at, end))
            at = end + chance.uniform(5.0, 60.0)
        for _ in range(int(LENGTH / 20.0)):
            victim = chance.choice([ROBOT, CONTROL]), chance.choice([WATCHDOG, CONTROLLER])
            simulation.at(chance.uniform(5.0, LENGTH), lambda victim=victim: processes[victim].kill())  # type: ignore[misc]
        simulation.run(LENGTH)
    return _judged(states, starts, times, cuts)


def _judged(
    states: dict[str, list[tuple[float, str]]],
    starts: dict[str, list[float]],
    times: list[tuple[float, float]],
    cuts: list[tuple[float, float]],
) -> Fight:
    def is_heard(host: str, time: float) -> bool:
        is_new = any(start <= time < start + NEW for start in starts[host])
        is_cut = host != ROBOT and any(begin < time and end > time - KNOWN for begin, end in cuts)
        return not is_new and not is_cut

    moves = [(at, after - before) for (_, before), (at, after) in itertools.pairwise(times)]
    contradictions = 0
    against = []
    for host, other in ((ROBOT, CONTROL), (CONTROL, ROBOT)):
        offs = [at for at, value in states[host] if value == OFF and is_heard(host, at)]
        ons = {round(at, 1) for at, value in states[other] if value == ON and is_heard(other, at)}
        contradictions += sum(round(at, 1) in ons for at in offs)
        moving = sorted(at for at, moved in moves if moved > 0.0)
        against += [
            at for at in moving if any(at - DRIVE_TIMEOUT + WAY < off < at - WAY for off in _near(offs, at))
        ]
    return Fight(contradictions, sum(moved for _, moved in moves), against)


def _near(sorted_times: list[float], time: float) -> list[float]:
    """Return the times of the second before a time."""
    return sorted_times[bisect(sorted_times, time - 1.0) : bisect(sorted_times, time)]


def test_no_controller_moves_the_joints_against_another() -> None:
    found = fight("1")
    assert found.contradictions
    assert found.moved > 10.0
    assert found.against == []


def test_drive_that_obeys_any_controller_is_found() -> None:
    with planted(NO_VETO):
        assert fight("1").against
