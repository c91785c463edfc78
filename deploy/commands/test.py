"""`make test`: most tests share the processors; those with bounds of time follow, few at a time or alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

PASSED, FAILED, WRONG_USE, NO_TESTS = 0, 1, 4, 5  # exit codes of pytest
PROCESSORS = os.cpu_count() or 1
PHASES = {"not timed and not alone": 2 * PROCESSORS, "timed": PROCESSORS, "alone": 1}  # and their workers


def main(arguments: Sequence[str]) -> int:
    """Run pytest for each phase with further arguments; print the results of all, return the exit code."""
    if missing := missing_paths(arguments):
        print(f"TESTS: {', '.join(missing)}: no such file or directory", file=sys.stderr)
        return WRONG_USE
    # All workers use what one of them has compiled.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    codes = []
    with tempfile.TemporaryDirectory() as directory:
        reports = Path(directory)
        for number, (marked, workers) in enumerate(PHASES.items()):
            options = ["--dist", "loadfile", "--no-loadscope-reorder", "-n", str(workers), "-m", marked]
            report = f"--junit-xml={reports / str(number)}"
            command = [sys.executable, "-m", "pytest", *options, *arguments, report]
            codes.append(subprocess.call(command, env=environment))
            if codes[-1] not in (PASSED, FAILED, NO_TESTS):
                print("Not all tests have run.", flush=True)
                break
        print(summary(reports), flush=True)
    return max((code for code in codes if code != NO_TESTS), default=NO_TESTS)


def summary(reports: Path) -> str:
    """Return how many tests passed, failed and were skipped, from the JUnit reports in a directory."""
    tests, failed, skipped = set(), set(), set()
    for report in reports.iterdir():
        for case in ElementTree.parse(report).iter("testcase"):
            test = case.get("classname"), case.get("name")  # it may fail and then its fixture: two cases
            tests.add(test)
            outcomes = {each.tag for each in case}
            if outcomes & {"failure", "error"}:
                failed.add(test)
            elif "skipped" in outcomes:
                skipped.add(test)
    skipped -= failed
    return f"{len(tests - failed - skipped)} passed, {len(failed)} failed, {len(skipped)} skipped"


def missing_paths(arguments: Sequence[str]) -> list[str]:
    """Return the paths that do not exist: pytest-xdist finds no tests in them, and does not say why."""
    return [
        word
        for before, word in pairwise(["", *arguments])
        # A word after an option may be its value.
        if not word.startswith("-") and ("=" in before or not before.startswith("-"))
        if not os.path.exists(word.partition("::")[0])
    ]


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends pytest, which cleans up and reports
    sys.exit(main(sys.argv[1:]))
