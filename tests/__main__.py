"""`make test`, `make test-all`: each test on what RUNTIME chooses, in virtual time, or on Cyclone DDS.

Most tests share the processors; those with bounds of time follow, few at a time or alone. `--untimed` leaves
them out, `-m node` takes the tests of a tier (tiers.py).
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from deploy.supervision.rclpy_choice import CYCLONEDDS, GROUND, RUNTIME, sourced_rclpy
from tests.runtimes import SIMULATED, is_in, left_out_here

PASSED, FAILED, WRONG_USE, NO_TESTS = 0, 1, 4, 5  # exit codes of pytest
ENDED = {PASSED, FAILED, NO_TESTS}
PROCESSORS = os.cpu_count() or 1
PHASES = {"not timed and not alone": 3 * PROCESSORS, "timed": PROCESSORS, "alone": 1}
"""The tests of each phase by their marks, and its workers: most tests of the first one wait for processes."""
IGNORE = "--ignore="
UNTIMED = "--untimed"
"""An option of this command: only the first phase."""


class Part(NamedTuple):
    rclpy: str
    runtime: str
    """the value of the environment variable RUNTIME"""
    arguments: list[str]


class Results(NamedTuple):
    passed: set[str]
    failed: set[str]
    skipped: set[str]

    def __str__(self) -> str:
        return f"{len(self.passed)} passed, {len(self.failed)} failed, {len(self.skipped)} skipped"


def main(arguments: Sequence[str]) -> int:
    """Run pytest for each part and phase; print the results of all, return the exit code."""
    phases = [*PHASES.items()][: 1 if UNTIMED in arguments else None]
    arguments = [word for word in arguments if word != UNTIMED]
    if missing := [path for path in paths(arguments) if not os.path.exists(path.partition("::")[0])]:
        # pytest-xdist finds no tests in them, and does not say why.
        print(f"TESTS: {', '.join(missing)}: no such file or directory", file=sys.stderr)
        return WRONG_USE
    total = Results(set(), set(), set())
    codes, lines = [], []
    for part in parts(arguments):
        with tempfile.TemporaryDirectory() as directory:
            codes += run(part, Path(directory), phases)
            results = results_in(Path(directory))
        lines.append(f"{part.rclpy}: {results}")
        total = Results(*(all_ | these for all_, these in zip(total, results, strict=True)))
        if not ENDED.issuperset(codes):
            break
    if not ENDED.issuperset(codes):
        lines.append("Not all tests have run.")
    elif left_out := uncollected(arguments, set.union(*total)):
        lines.append(f"No test of these files has run: {' '.join(left_out)}")
        codes.append(FAILED)
    print(*lines, total, sep="\n", flush=True)
    return max((code for code in codes if code != NO_TESTS), default=NO_TESTS)


def parts(arguments: Sequence[str]) -> list[Part]:
    """Return the tests for the rclpy of this process, those in virtual time, and the others."""
    if os.environ.get(GROUND):
        return [Part("Cyclone DDS", CYCLONEDDS, [*arguments])]
    given = paths(arguments)
    options = [word for word in arguments if word not in given]
    needy = [path for path in left_out_here(simulated=False) if not is_in(path, ignored(arguments))]
    here = [path for path in given if not is_in(path, needy)]
    elsewhere = [path for path in given if is_in(path, needy)]
    elsewhere += [path for path in needy if is_in(path, here) or not given]
    simulated = [path for path in elsewhere if is_in(path, SIMULATED)]
    on_cyclonedds = [] if sourced_rclpy() else [path for path in elsewhere if path not in simulated]
    found = [Part("ROS 2's rclpy", "", [*options, *here])] if here or not given else []
    if simulated:
        found.append(Part("Virtual time", "", [*options, *simulated]))
    if on_cyclonedds:
        found.append(Part("Cyclone DDS", CYCLONEDDS, [*options, *on_cyclonedds]))
    return found


def run(part: Part, reports: Path, phases: Iterable[tuple[str, int]] = PHASES.items()) -> list[int]:
    """Run pytest for each phase; return its exit codes. Reports (JUnit) go to a directory."""
    environment = os.environ | {RUNTIME: part.runtime, GROUND: part.runtime}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # all workers use what one of them has compiled
    codes: list[int] = []
    for marked, workers in phases:
        options = ["--dist", "loadfile", "--no-loadscope-reorder", "-n", str(workers)]
        selected = [*part.arguments]
        if "-m" in selected:
            value = selected.index("-m") + 1
            marked = f"({selected[value]}) and {marked}"
            del selected[value - 1 : value + 1]
        report = f"--junit-xml={reports / str(len(codes))}"
        command = [sys.executable, "-m", "pytest", *options, "-m", marked, *selected, report]
        codes.append(subprocess.call(command, env=environment))
        if codes[-1] not in ENDED:
            break
    return codes


def results_in(reports: Path) -> Results:
    tests, failed, skipped = set(), set(), set()
    for report in reports.iterdir():
        for case in ElementTree.parse(report).iter("testcase"):
            test = f"{case.get('classname')}.{case.get('name')}"
            tests.add(test)  # once, even if it fails and then its fixture: these are two cases
            outcomes = {each.tag for each in case}
            if outcomes & {"failure", "error"}:
                failed.add(test)
            elif "skipped" in outcomes:
                skipped.add(test)
    skipped -= failed
    return Results(tests - failed - skipped, failed, skipped)


def uncollected(arguments: Sequence[str], tests: Iterable[str]) -> list[str]:
    """Return the files without a known test, if all tests below some folders should have run."""
    given = paths(arguments)
    if len(given) + len(ignored(arguments)) < len(arguments) or any("::" in path for path in given):
        return []  # an option selects tests
    names = "\n".join(f".{test}." for test in tests)
    files = {file for path in given for file in Path(path).rglob("test_*.py")}
    unseen = (str(file) for file in files if f".{'.'.join(file.with_suffix('').parts)}." not in names)
    one_ground = sourced_rclpy() or os.environ.get(GROUND)
    not_here = (*left_out_here(simulated=True), *ignored(arguments)) if one_ground else ignored(arguments)
    return sorted(file for file in unseen if not is_in(file, not_here))


def paths(arguments: Sequence[str]) -> list[str]:
    """Return the words that are paths; a word after an option may be its value."""
    return [
        word
        for before, word in pairwise(["", *arguments])
        if not word.startswith("-") and ("=" in before or not before.startswith("-"))
    ]


def ignored(arguments: Sequence[str]) -> list[str]:
    return [word.removeprefix(IGNORE) for word in arguments if word.startswith(IGNORE)]


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends pytest, which cleans up and reports
    sys.exit(main(sys.argv[1:]))
