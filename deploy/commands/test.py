"""`make test`: most tests wait, so they share the processors; those marked `alone` follow, one by one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence

PASSED, FAILED, NO_TESTS = 0, 1, 5  # exit codes of pytest
WORKERS = 2 * (os.cpu_count() or 1)
PHASES = (
    ["-n", str(WORKERS), "--dist", "loadfile", "--no-loadscope-reorder", "-m", "not alone"],
    ["-m", "alone"],
)


def main(arguments: Sequence[str]) -> int:
    """Run pytest for each phase with further arguments; return its exit code."""
    codes = []
    for options in PHASES:
        codes.append(subprocess.call([sys.executable, "-m", "pytest", *options, *arguments]))
        if codes[-1] not in (PASSED, FAILED, NO_TESTS):
            return codes[-1]
    return max((code for code in codes if code != NO_TESTS), default=NO_TESTS)


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C ends pytest, which cleans up and reports
    sys.exit(main(sys.argv[1:]))
