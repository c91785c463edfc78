"""`make test`: most tests share the processors; those with bounds of time follow, few at a time or alone."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence

PASSED, FAILED, NO_TESTS = 0, 1, 5  # exit codes of pytest
PROCESSORS = os.cpu_count() or 1
PHASES = {"not timed and not alone": 2 * PROCESSORS, "timed": PROCESSORS, "alone": 1}  # and their workers


def main(arguments: Sequence[str]) -> int:
    """Run pytest for each phase with further arguments; return its exit code."""
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


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends pytest, which cleans up and reports
    sys.exit(main(sys.argv[1:]))
