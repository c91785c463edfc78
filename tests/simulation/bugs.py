"""Bugs planted by hand in the two services that turn the engines off: does the simulation find each of them?

    .venv/bin/python -m tests.simulation.bugs

runs an hour of `make simulate` with each bug and each of three seeds, and says when a promise is violated.
"""

from __future__ import annotations

import itertools
import multiprocessing
import sys
import tempfile
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple
from unittest import mock

from deploy.supervision import parameter_file
from deploy.supervision.manifest import Program
from deploy.supervision.processes import ROOT
from tests.promises.history import CONTROLLER, DRIVE, WATCHDOG
from tests.simulation import arm, plan
from tests.simulation.faults import FAULT_KINDS
from tests.simulation.outcome import simulate

SEEDS = ("1", "2", "3")
EVERY = 5.0  # s between two random faults, as by default


class Bug(NamedTuple):
    program: str
    right: str
    wrong: str


BUGS: dict[str, Bug] = {
    "a presence is stamped now": Bug(
        WATCHDOG,
        "presence.map(lambda it: it.seen)",
        "presence.map(lambda it: __import__('reactive_node').stamps.now())",
    ),
    "a presence is as young as its arrival": Bug(
        CONTROLLER, "Presence(it.timestamp, node.age(it.value))", "Presence(it.timestamp, 0.0)"
    ),
    "a heartbeat counts for nine seconds": Bug(
        WATCHDOG, "lifespan: float = parameter(0.5,", "lifespan: float = parameter(9.0,"
    ),
    "the controller waits 14 s": Bug(CONTROLLER, "10.0, (1.0, 10.0), ", "14.0, (1.0, 14.0), "),
    "strikes never count": Bug(WATCHDOG, ".retry(parameters.strikes)", ".retry()"),
    "a strike takes 4 s": Bug(WATCHDOG, "silence: float = parameter(3.0,", "silence: float = parameter(4.0,"),
    "a released switch is a sign of life": Bug(
        WATCHDOG,
        "        topics.OPERATOR_HEARTBEAT, parameters.reading",
        "        replace(topics.OPERATOR_HEARTBEAT, problem=lambda _: ''), parameters.reading",
    ),
    "a presence from the future counts": Bug(CONTROLLER, "if age < -CLOCK_TOLERANCE:", "if age < -1e12:"),
    "an older presence replaces a newer one": Bug(CONTROLLER, "seen=max(latch.seen, ", "seen=min(event.at, "),
    "the controller is deaf to turn_off": Bug(
        CONTROLLER,
        "engines = ON if command == topics.TURN_ON else OFF",
        "engines = ON if command == topics.TURN_ON else latch.engines",
    ),
    "the latch starts on": Bug(
        CONTROLLER, "Turn()", "Turn(after=Latch(ON, *2 * [Latch().seen.replace(year=9999)]))"
    ),
    "turn_on needs no presence": Bug(
        CONTROLLER, "latch.why_refused(", "latch._replace(seen=event.at).why_refused("
    ),
    "the controller does not notice its pause": Bug(
        CONTROLLER, "(paused > DRIVE_TIMEOUT or unseen", "(unseen"
    ),
    "turn_off is sent once": Bug(WATCHDOG, "rx.merge(away.filter(bool), again)", "away.filter(bool)"),
    "clocks may differ by 0.25 s": Bug(
        CONTROLLER, "if age < -CLOCK_TOLERANCE:", "if age < -5 * CLOCK_TOLERANCE:"
    ),
    "the drive obeys any controller": Bug(DRIVE, "(unopposed(states).map", "(states.map"),
    "an on makes the drive forget an off": Bug(
        DRIVE,
        "(unopposed(states).map",
        "(states.scan(lambda before, it: it._replace(off=before.at if before.name != ON else NEVER))"
        ".filter(lambda it: it.name != ON or (it.at - it.off).total_seconds() >= 0.4).map",
    ),
    "the drive ignores the 400 ms": Bug(
        DRIVE, "return state.young_until if", "return state.young_until.replace(year=9999) if"
    ),
}
"""The first four are hidden by the other fail-safes unless one of them stands alone."""

QUICK_BUGS: dict[str, Bug] = {
    "the watchdog keeps the silence of the thesis": Bug(
        WATCHDOG, ".timeout(parameters.silence)", ".timeout(3.0)"
    ),
    "the controller keeps the timeout of the thesis": Bug(
        CONTROLLER, "unseen >= parameters.presence_timeout)", "unseen >= 10.0)"
    ),
}
"""With the parameters of the thesis, nothing shows these: only the bounds of deploy/quick.yaml find them."""
PROFILES: dict[str, Mapping[str, Any]] = {
    "thesis": {},
    "quick": parameter_file.load(str(ROOT / "deploy" / "quick.yaml"), "/"),
}
CASES = [*((name, "thesis") for name in BUGS), *((name, "quick") for name in QUICK_BUGS)]
"""Each bug with the parameters by which it must be found."""


@contextmanager
def planted(bug: Bug) -> Iterator[None]:
    """Run a service with a bug in simulated arms until the end of the ``with``."""
    program = next(each for each in arm.PROGRAMS if each.name == bug.program)
    code = (ROOT / (program.module.replace(".", "/") + ".py")).read_text(encoding="utf-8")
    if code.count(bug.right) != 1:
        raise ValueError(f"{program.module} has {bug.right!r} {code.count(bug.right)} times, not once")
    code = code.replace("from dataclasses import dataclass", "from dataclasses import dataclass, replace")
    module = f"broken_{bug.program}"
    broken = [each if each is not program else Program(each.name, module, ()) for each in arm.PROGRAMS]
    with (
        tempfile.TemporaryDirectory(prefix="reactive-arm-") as directory,
        mock.patch.object(sys, "path", [directory, *sys.path]),
        mock.patch.object(arm, "PROGRAMS", tuple(broken)),
    ):
        Path(directory, f"{module}.py").write_text(code.replace(bug.right, bug.wrong), encoding="utf-8")
        yield


def first_violation(case: tuple[str, str], seed: str) -> str:
    """Return which promises an hour of a seed with a bug violates first, and when; empty if none."""
    minutes = 0.0
    name, profile = case
    with planted((BUGS | QUICK_BUGS)[name]):
        for experiment in plan.experiments(seed, 1.0, EVERY, tuple(FAULT_KINDS), PROFILES[profile]):
            outcome = simulate(experiment)
            if promises := outcome.violated():
                first = min(each.time for finding in outcome.findings for each in finding.evidence)
                return f"{', '.join(promises)} after {minutes + first / 60.0:.0f} min"
            minutes += experiment.length / 60.0
    return ""


def main() -> int:
    """Print a row for each bug and seed; return the exit code."""
    cases = list(itertools.product(CASES, SEEDS))
    missed = 0
    with ProcessPoolExecutor(mp_context=multiprocessing.get_context("spawn")) as pool:
        found = pool.map(first_violation, *zip(*cases, strict=True))
        for ((name, _), seed), violation in zip(cases, found, strict=True):
            print(f"{name}, seed {seed}: {violation or 'NOT FOUND'}", flush=True)
            missed += not violation
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
