"""`make test`: most tests share the processors; those with bounds of time follow, few at a time or alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from itertools import pairwise

PASSED, FAILED, WRONG_USE, NO_TESTS = 0, 1, 4, 5  # exit codes of pytest
PROCESSORS = os.cpu_count() or 1
PHASES = {"not timed and not alone": 2 * PROCESSORS, "timed": PROCESSORS, "alone": 1}  # and their workers


def main(arguments: Sequence[str]) -> int:
    """Run pytest for each phase with further arguments; return its exit code."""
    if missing := missing_paths(arguments):
        print(f"TESTS: {', '.join(missing)}: no such file or directory", file=sys.stderr)
        return WRONG_USE
    # All workers use what one of them has compiled.
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    codes = []
    for marked, workers in PHASES.items():
        options = ["--dist", "loadfile", "--no-loadscope-reorder", "-n", str(workers)]
        command = [sys.executable, "-m", "pytest", *options, "-m", marked, *arguments]
        codes.append(subprocess.call(command, env=environment))
        if codes[-1] not in (PASSED, FAILED, NO_TESTS):
            return codes[-1]
    return max((code for code in codes if code != NO_TESTS), default=NO_TESTS)


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
