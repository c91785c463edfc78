"""`make chaos`: unleash the monkey, and tell what it found. Exit code 1 if a promise is violated.

usage: python -m deploy.chaos [--minutes 5] [--seed N] [--scenario NAME] [--every 5] [--faults kill,stop]
                              [--targets kinematics,velocity] [--arms 10] [--loss PERCENT]
                              [--replay RECORD]
"""

from __future__ import annotations

import argparse
import fcntl
import math
import os
import random
import shutil
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from deploy.chaos import partition, record, schedule
from deploy.chaos.arena import SCENARIO, Arena
from deploy.chaos.cost import Cost
from deploy.chaos.faults import FAULTS
from deploy.chaos.findings import VIOLATED
from deploy.chaos.history import CIRCUMSTANCES, PROGRAMS, suffix
from deploy.chaos.page import page
from deploy.chaos.promises import CHECKERS
from deploy.chaos.report import text
from deploy.supervision import interruption, processes
from deploy.supervision.system import DeploymentError, System
from interfaces import topics
from reactive_node.domains import DOMAINS

SCENARIOS = ("monkey", *partition.SCHEDULES, *schedule.NAMED)
KEPT = 10  # records


def main(arguments: Sequence[str]) -> int:
    """Obey the command line; the exit code."""
    interruption.install()
    options = _options(arguments)
    try:
        if options.replay:
            return conclude(options.replay, f"Record {options.replay}", "replay")
        return unleash(options)
    except interruption.Interrupted:
        print("Interrupted: everything has been stopped.")
        return 130
    except (DeploymentError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


def unleash(options: argparse.Namespace) -> int:
    """Start an arm, let the monkey play, and judge."""
    kind: type[Arena] = Arena
    if options.scenario == "monkey":
        seed = random.randrange(10**6) if options.seed is None else options.seed
        length = 60 * options.minutes
        planned = schedule.monkey(
            seed, length, every=options.every, kinds=options.faults, targets=options.targets
        )
        if not planned:
            raise DeploymentError(
                "No fault is planned: the time is too short, or nothing of this can be done to that."
            )
        schedules = [planned[arm :: options.arms] for arm in range(options.arms)]
        title = f"Random monkey, seed {seed}, {options.minutes:g} min, a fault each {options.every:g} s"
        if options.faults != tuple(FAULTS) or options.targets:
            title += f" of {', '.join(options.faults)} to {', '.join(options.targets) or 'all'}"
    elif options.scenario in partition.SCHEDULES:
        if reason := partition.missing(options.scenario):
            raise DeploymentError(f"No {options.scenario} here: {reason}")
        kind, length = partition.TwoHosts, partition.LENGTH
        schedules = [partition.SCHEDULES[options.scenario]]
        title = f"Scenario {options.scenario}: the network between the operator's host and the robot's"
    else:
        planned = schedule.NAMED[options.scenario]()
        schedules = [planned] * options.arms
        length = schedule.duration(planned)
        title = f"Scenario {options.scenario}, {length:.0f} s"
    if options.arms > 1:
        title += f", {options.arms} arms"
    if options.loss:
        title += f", {options.loss:g} % loss"
    print(title, flush=True)
    with _directory() as directory:
        arena = kind(
            directory,
            **_fleet(options.arms),
            say=lambda text: print(text, flush=True),
            check=interruption.check,
            loss=options.loss,
        )
        with arena:
            before = Cost.now(arena.arms)
            arena.play(schedules, length)
            cost = Cost.now(arena.arms).since(before)
        print("\n" + cost)
        return conclude(arena.record, f"{title}, {cost}")


def _fleet(arms: int) -> dict[str, Any]:
    """The options of an arena with so many arms, each in a namespace of its own."""
    if arms == 1:
        return {}
    # Slower, as befits many arms on one machine, but still a message of each stream every 100 ms.
    slow = {name: {**SCENARIO[name], "rate": 10.0} for name in topics.CONFIGURATION}
    return {
        "namespaces": tuple(f"/arm{number}" for number in range(1, arms + 1)),
        "scenario": {**SCENARIO, **slow},
    }


def conclude(path: Path, title: str, page_name: str = "report") -> int:
    """Judge what a record tells of each of its arms, and write a page for each; the exit code."""
    namespaces = record.namespaces(path)
    if not namespaces:
        raise DeploymentError(f"{path} tells of no arm")
    broken = [
        namespace for namespace in namespaces if not _keeps_its_promises(path, title, namespace, page_name)
    ]
    if len(namespaces) > 1:
        verdict = f"promises are broken for {', '.join(broken)}" if broken else "no promise is broken"
        print(f"\n{len(namespaces)} arms: {verdict}")
    return int(bool(broken))


def _keeps_its_promises(path: Path, title: str, namespace: str, page_name: str) -> bool:
    """Judge an arm, print the verdict and write the page beside its record."""
    interruption.check()
    history = record.load(path, namespace)
    findings = []
    for checker in CHECKERS.values():
        interruption.check()
        findings.append(checker(history))
    print("\n" + (f"{namespace}\n" if namespace != "/" else "") + text(findings))
    report = path.with_name(f"{page_name}{suffix(namespace)}.html")
    faults = sum(fault.kind not in CIRCUMSTANCES for fault in history.faults)
    messages = sum(map(len, history.streams.values()))
    remarks = [
        f"{title} · {faults} faults · {messages} messages in {history.end:.0f} s",
        f"{time.strftime('%Y-%m-%d %H:%M')} · {os.cpu_count()} cores · record {path.name} (MCAP)",
    ]
    report.write_text(page(title, remarks, findings, history), encoding="utf-8")
    print(f"\nReport: {report}\nRecord: {path}")
    return not any(finding.verdict == VIOLATED for finding in findings)


def _options(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make chaos", description="unleash the chaos monkey")
    parser.add_argument("--minutes", type=_positive, default=5.0)
    parser.add_argument("--seed", type=int, help="the same seed, the same faults; default: a new one")
    parser.add_argument("--every", type=_positive, default=5.0, help="seconds from fault to fault")
    parser.add_argument("--scenario", choices=SCENARIOS, default="monkey")
    parser.add_argument(
        "--arms",
        type=_count,
        default=1,
        help="a fleet; the monkey turns to one after the other, a scenario is played to each",
    )
    parser.add_argument("--loss", type=_percent, default=0.0, help="percent of all DDS packets that are lost")
    parser.add_argument("--faults", type=_words(FAULTS), default=tuple(FAULTS), help=", ".join(FAULTS))
    parser.add_argument("--targets", type=_words(PROGRAMS), default=(), help=", ".join(PROGRAMS))
    parser.add_argument("--replay", type=Path, help="only judge a record")
    options = parser.parse_args(arguments)
    if options.arms > 1 and options.scenario in partition.SCHEDULES:
        parser.error(f"{options.scenario} is played with one arm")
    if options.arms > len(DOMAINS):
        parser.error(f"{options.arms} arms need as many ROS domains, of which there are {len(DOMAINS)}")
    if options.scenario != "monkey" and any(
        getattr(options, name) != parser.get_default(name) for name in ("every", "faults", "targets")
    ):
        parser.error("--every, --faults and --targets are for the random monkey: not with --scenario")
    return options


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is no number of arms")
    return int(text)


def _percent(text: str) -> float:
    number = _number(text)
    if not 0 <= number <= 100:
        raise argparse.ArgumentTypeError(f"{text} is not from 0 to 100")
    return number


def _positive(text: str) -> float:
    number = _number(text)
    if not 0 < number < math.inf:
        raise argparse.ArgumentTypeError(f"{text} is not more than 0")
    return number


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text} is no number") from None


def _words(known: Iterable[str]) -> Callable[[str], tuple[str, ...]]:
    names = list(known)

    def parse(text: str) -> tuple[str, ...]:
        words = tuple(word.strip() for word in text.split(","))
        for word in words:
            if word not in names:
                raise argparse.ArgumentTypeError(f"{word!r} is none of {', '.join(names)}")
        return words

    return parse


@contextmanager
def _directory() -> Iterator[Path]:
    """A directory for this play, of which there is one at a time; of the older ones the latest are kept."""
    base = processes.run_directory() / "chaos"
    base.mkdir(parents=True, exist_ok=True)
    with _opened(base) as descriptor:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DeploymentError(f"A monkey plays already in {base}") from None
        old = sorted(base.glob("????????-??????"))
        for directory in old:
            for run in directory.glob("run*"):
                System(run).stop()  # what a killed monkey has left behind
        for directory in old[: 1 - KEPT]:
            shutil.rmtree(directory)
        directory = base / time.strftime("%Y%m%d-%H%M%S")
        try:
            yield directory
        finally:
            if not (directory / "record.mcap").exists():  # nothing came of it
                shutil.rmtree(directory, ignore_errors=True)


@contextmanager
def _opened(directory: Path) -> Iterator[int]:
    """An open file descriptor of a directory."""
    descriptor = os.open(directory, os.O_RDONLY)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
