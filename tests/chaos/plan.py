"""The plan of `make chaos`: the command line, and the schedules and the testbed that follow from it."""

from __future__ import annotations

import argparse
import random
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from deploy.supervision import parameter_file
from deploy.supervision.errors import DeploymentError
from reactive_node.domains import DOMAINS
from tests.chaos import clock, partition, schedule, schedule_file, second_host
from tests.chaos.faults import FAULT_KINDS
from tests.chaos.schedule import Schedule
from tests.chaos.testbed import SCENARIO, Testbed, sources
from tests.promises import marks

RANDOM = "monkey"  # the scenario of random faults
FLEET_RATE = 10.0  # Hz, of each source; many arms share the machine
HOSTS: dict[str, tuple[Schedule, float, Callable[..., Testbed]]] = {
    **{
        name: (planned, partition.LENGTH, partition.TwoHosts) for name, planned in partition.SCHEDULES.items()
    },
    "second_host": (second_host.SCHEDULE, second_host.LENGTH, second_host.SecondHost),
}
"""The scenarios of two hosts."""
NAMED = (*HOSTS, *schedule.SCENARIOS)


class Plan(NamedTuple):
    """An experiment: the faults, the arms, and the length of the record."""

    title: str
    schedules: list[Schedule]
    """For each arm."""
    length: float
    """[s]."""
    testbed: Callable[..., Testbed]

    @property
    def steps_clock(self) -> bool:
        """Whether the faults include a step of the time of day."""
        return any(each.kind == marks.STEP for planned in self.schedules for each in planned)


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Parse the command line; exits with code 2 if it has an error."""
    parser = argparse.ArgumentParser(
        prog="make chaos",
        usage='make chaos [MINUTES=N] [SEED=WORD] [CHAOS="OPTION ..."]',
        description="Inject faults into an arm, record it from outside, and check the promises.",
    )
    add = parser.add_argument
    add("--minutes", type=number(0.01, 10_000), default=5.0, help="length of the random faults, default 5")
    add("--seed", help="the same seed gives the same random faults")
    # What a schedule file does not say: it states faults, and neither the arms nor their network.
    scenarios = f"instead of random faults: {', '.join(NAMED)}"
    add("--scenario", choices=(RANDOM, *NAMED), default=RANDOM, metavar="NAME", help=scenarios)
    add("--arms", type=int, default=1, help="they share the random faults; each gets a whole scenario")
    add("--loss", type=number(0, 100), default=0.0, help="percent of all DDS packets that are lost")
    add("--schedule", type=Path, metavar="FILE", help="run a schedule, such as `make simulate` writes")
    add("--parameters", default="", metavar="FILE", help="a ROS parameter file for the services")
    add("--replay", type=Path, metavar="RECORD", help="only judge a record")
    options = parser.parse_args(arguments)
    if not 1 <= options.arms <= len(DOMAINS):
        parser.error(f"--arms must be from 1 to {len(DOMAINS)}: each arm needs a ROS domain")
    if options.arms > 1 and options.scenario in HOSTS:
        parser.error(f"--scenario {options.scenario} allows only one arm")
    if options.schedule and (options.scenario != RANDOM or options.arms > 1 or options.parameters):
        parser.error("--schedule has faults and parameters of its own, for one arm")
    return options


def plan(options: argparse.Namespace) -> Plan:
    """Return the plan of a command line. Raises DeploymentError if it is empty, or not possible here."""
    planned = _faults_and_arms(options)
    if not options.parameters:
        return planned
    testbed = partial(planned.testbed, parameters=partial(parameter_file.load, options.parameters))
    return planned._replace(title=f"{planned.title}, {options.parameters}", testbed=testbed)


def _faults_and_arms(options: argparse.Namespace) -> Plan:
    if options.scenario in HOSTS:
        if reason := partition.missing(options.scenario):
            raise DeploymentError(f"{options.scenario} is not possible on this machine: {reason}")
        title = f"Scenario {options.scenario}: the network between two hosts"
        faults, seconds, hosts = HOSTS[options.scenario]
        return Plan(title, [faults], seconds, hosts)
    if options.schedule:
        return _scheduled(options.schedule)
    several = f", {options.arms} arms" if options.arms > 1 else ""
    testbed = _fleet(options.arms) if options.arms > 1 else Testbed
    if options.scenario != RANDOM:
        planned = schedule.possible(schedule.SCENARIOS[options.scenario]())
        length = schedule.duration(planned)
        title = f"Scenario {options.scenario}, {length:.0f} s{several}"
        return Plan(title, [planned] * options.arms, length, testbed)
    seed = options.seed or str(random.randrange(10**6))
    length = 60 * options.minutes
    planned = schedule.random_faults(seed, length)
    if not planned:
        raise DeploymentError("No fault is planned: the time is too short")
    title = f"Random faults, seed {seed}, {options.minutes:g} min{several}"
    every, planned = len(planned), schedule.possible(planned)
    if left_out := every - len(planned):  # the others are those of each machine
        title += f", {left_out} of {marks.STEP} left out: {clock.missing()}"
    return Plan(title, [planned[arm :: options.arms] for arm in range(options.arms)], length, testbed)


def _scheduled(path: Path) -> Plan:
    experiment = schedule_file.load(path)
    kinds = {each.kind for each in experiment.faults}
    if marks.STEP in kinds and (reason := clock.missing()):
        raise DeploymentError(f"{marks.STEP} is not possible on this machine: {reason}")
    if unknown := sorted(kinds - FAULT_KINDS.keys()):
        raise DeploymentError(f"{path}: only make simulate can inject {', '.join(unknown)}")
    title = f"Schedule {path}, {experiment.length:.0f} s"
    testbed = partial(
        Testbed, scenario=experiment.scenario, parameters=lambda namespace: experiment.parameters
    )
    return Plan(title, [experiment.faults], experiment.length, testbed)


def _fleet(arms: int) -> Callable[..., Testbed]:
    namespaces = tuple(f"/arm{number}" for number in range(1, arms + 1))
    return partial(Testbed, namespaces=namespaces, scenario={**SCENARIO, **sources(FLEET_RATE)})


def number(least: float, most: float) -> Callable[[str], float]:
    """Return a parser of numbers of the command line."""

    def parse(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text} is not from {least:g} to {most:g}")
        return value

    return parse


def names(known: Iterable[str]) -> Callable[[str], tuple[str, ...]]:
    """Return a parser of names of the command line, with commas between."""
    all_names = list(known)

    def parse(text: str) -> tuple[str, ...]:
        words = tuple(word.strip() for word in text.split(","))
        for word in words:
            if word not in all_names:
                raise argparse.ArgumentTypeError(f"{word!r} is not one of {', '.join(all_names)}")
        return words

    return parse
