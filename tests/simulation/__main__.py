"""`make simulate`: hours of an arm under faults, in virtual time, judged by its promises.

Exit code 1 if a promise is violated. Then the smallest schedule that violates it is in a file.
"""

from __future__ import annotations

import argparse
import math
import random
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from deploy.operator.output import use_plain_output
from deploy.supervision import interruption, parameter_file, processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import make_directory
from interfaces.service import UserError
from tests.chaos import schedule_file
from tests.chaos.plan import names, number
from tests.chaos.schedule_file import Experiment
from tests.promises.findings import count, how_often
from tests.promises.history import STUCK_DRIVE
from tests.promises.html_report import html, verdict
from tests.promises.text_report import text
from tests.simulation import plan, systematic, two_hosts
from tests.simulation.attacks import CLAIMS
from tests.simulation.faults import FAULT_KINDS
from tests.simulation.outcome import Outcome, simulate
from tests.simulation.shrink import shrink
from tests.simulation.summary import Summary
from tests.simulation.workers import summaries

BAR = 30  # characters


def main(arguments: Sequence[str]) -> int:
    interruption.install()
    use_plain_output()
    try:
        return _run(_parse(arguments))
    except interruption.Interrupted:
        print("Interrupted.")
        return 130
    except (DeploymentError, UserError) as error:
        print(error, file=sys.stderr)
        return 1


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="make simulate",
        usage='make simulate [HOURS=N] [SEED=WORD] [SCHEDULE=FILE] [SIMULATE="OPTION ..."]',
        description="Simulate an arm under faults, and check its promises.",
    )
    add = parser.add_argument
    add("--hours", type=number(0.01, 100_000), default=1.0, help="of the arm, default 1")
    add("--seed", help="the same seed gives the same record, byte for byte; default: a new one")
    add("--every", type=number(0.1, 3600), default=5.0, help="seconds between two faults, default 5")
    of_kinds = (
        "only these random faults, and no attacks on the fail-safes; separated by commas, "
        f"of {', '.join(FAULT_KINDS)}"
    )
    add("--faults", type=names(FAULT_KINDS), default=tuple(FAULT_KINDS), help=of_kinds)
    add("--schedule", type=Path, metavar="FILE", help="run this schedule instead")
    add("--parameters", default="", metavar="FILE", help="a ROS parameter file for the services")
    minutes = "for a number of minutes, inject faults at every message and timer of an operator's day instead"
    two = "two whole arms, on two hosts that are cut from each other and healed"
    add("--two-hosts", action="store_true", help=two)
    add("--systematic", type=number(0.01, 100_000), metavar="MINUTES", help=minutes)
    options = parser.parse_args(arguments)
    if options.parameters and (options.schedule or options.systematic):
        parser.error("--parameters are for random faults: a schedule has parameters of its own")
    if options.two_hosts and (
        options.schedule or options.systematic or set(options.faults) != set(FAULT_KINDS)
    ):
        parser.error("--two-hosts has faults of its own")
    return options


def _run(options: argparse.Namespace) -> int:
    if options.schedule:
        return _conclude(simulate(schedule_file.load(options.schedule)), f"Schedule {options.schedule}")
    seed = options.seed or str(random.randrange(10**6))
    if options.systematic:
        experiments, title = systematic.cases(seed)
        return _run_all(experiments, title, 60 * options.systematic)
    parameters = parameter_file.load(options.parameters, "/") if options.parameters else {}
    if options.two_hosts:
        experiments = two_hosts.experiments(seed, options.hours, options.every, parameters)
    else:
        experiments = plan.experiments(seed, options.hours, options.every, options.faults, parameters)
    what = "Two simulated arms on two hosts" if options.two_hosts else "Simulated arm"
    title = f"{what}, seed {seed}, {options.hours:g} h, a fault every {options.every:g} s"
    if options.parameters:
        title += f", {options.parameters}"
    return _run_all(experiments, title, math.inf)


def _run_all(experiments: Sequence[Experiment], title: str, limit: float) -> int:
    """Run experiments, at most for so many seconds, and report; return the exit code."""
    print(title, flush=True)
    hours = sum(experiment.length for experiment in experiments) / 3600.0
    summary, broken = Summary(), list[Experiment]()
    began = time.monotonic()
    interrupted = False

    def show() -> None:
        _show(summary, hours, time.monotonic() - began, len(broken))

    try:
        with repeatedly(show):
            for experiment, part in zip(experiments, summaries(experiments), strict=False):
                summary.add(part)
                if part.violated():
                    broken.append(experiment)
                if time.monotonic() - began > limit:
                    break
    except interruption.Interrupted:
        interrupted = True
    if not summary.experiments:
        raise interruption.Interrupted
    print(report(summary, time.monotonic() - began))
    if broken and not interrupted:
        return _explain(broken[0], title)
    return int(bool(broken)) or (130 if interrupted else 0)


@contextmanager
def repeatedly(show: Callable[[], None]) -> Iterator[None]:
    """Call a function at once, every second and at the end: an experiment takes half a minute."""
    ended = threading.Event()

    def repeat() -> None:
        show()
        while not ended.wait(1.0):
            show()

    thread = threading.Thread(target=repeat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        show()


def _show(summary: Summary, hours: float, seconds: float, broken: int) -> None:
    if not sys.stdout.isatty():
        return
    done = BAR * min(1.0, summary.hours / hours)
    bar = "#" * int(done) + "." * (BAR - int(done))
    state = f"{count(broken, 'experiment')} with a violation" if broken else "no violation"
    line = f"[{bar}] {summary.hours:.1f} of {hours:g} h after {seconds:.0f} s, {state} "
    width = shutil.get_terminal_size().columns - 1
    print(f"\r{line[:width]}", end="", file=sys.__stdout__)  # the carriage return is ours


def report(summary: Summary, seconds: float) -> str:
    """Return what experiments have shown in a time of this machine [s]."""
    kinds = ", ".join(f"{kind} {number}" for kind, number in sorted(summary.injected.items()))
    speed = 3600.0 * summary.hours / seconds
    return (
        f"\n{text(summary.total())}\n\n"
        f"{count(summary.injected.total(), 'fault')}: {kinds}\n"
        f"{_alone(summary)}"
        f"{count(summary.restarts, 'restart')}, {count(summary.messages, 'message')}; "
        f"record {summary.digest}\n"
        f"{count(summary.experiments, 'experiment')}, {summary.hours:.2f} h in {seconds:.0f} s: "
        f"{speed:.0f} times real time"
    )


def _alone(summary: Summary) -> str:
    """Return how often each claim stood alone, in a line; empty if no silence was attacked."""
    if not summary.injected[STUCK_DRIVE]:
        return ""
    numbers = ", ".join(f"{each} {how_often(summary.alone[each])}" for each in CLAIMS)
    return f"What stopped the arm alone: {numbers}\n"


def _explain(experiment: Experiment, title: str) -> int:
    outcome = simulate(experiment)
    faults = len(experiment.faults)
    print(f"\nLooking for the fewest faults that violate {outcome.violated()[0]}, of {faults}")

    def report(faults: int) -> None:
        interruption.check()
        print(f"  {count(faults, 'fault')}", flush=True)

    return _conclude(shrink(outcome, report), title)


def _conclude(outcome: Outcome, title: str) -> int:
    experiment = outcome.experiment
    directory = processes.run_directory() / "simulation"
    name = "".join(each if each.isalnum() else "-" for each in experiment.seed)
    schedule, written = directory / f"{name}.yaml", directory / f"{name}.html"
    make_directory(directory)
    schedule_file.save(experiment, schedule)
    remarks = [f"{title} · {count(len(experiment.faults), 'fault')} in {experiment.length:.0f} s"]
    written.write_text(html(title, remarks, outcome.findings, outcome.history), encoding="utf-8")
    print(f"\n{text(outcome.findings, outcome.history)}\n\n{verdict(outcome.findings)}")
    print(f"Report: {written}\nRun it again: make simulate SCHEDULE={schedule}")
    return int(bool(outcome.violated()))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
