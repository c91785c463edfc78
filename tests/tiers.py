"""The tier of each test: what it runs, and so what it costs and what it shows (tests/README.md)."""

from __future__ import annotations

from collections.abc import Collection
from functools import cache
from pathlib import Path

from tests.runtimes import SIMULATED, is_in

UNIT, NODE, ARM = "unit", "node", "arm"  # the markers of pytest
PROCESSES = (
    "deploy/ground/tests/interop",
    "deploy/tools/tests/cli",
    "tests/benchmarks",
    "tests/operator/page/browser",
    "tests/security/attacks",
    "tests/simulation_kit/tests/test_against_cyclone_dds.py",
    "tests/system",
)
"""Tests whose fixtures start processes."""
STARTS = ("subprocess", "Popen", "ChaosRun")
"""Names in a file that starts processes."""


def tier(file: Path, fixtures: Collection[str]) -> str:
    """Return the tier of a test by its file and its fixtures."""
    if is_in(str(file), PROCESSES):
        return ARM
    if is_in(str(file), SIMULATED):
        return UNIT
    if _starts_processes(file):
        return ARM
    return NODE if "domain_id" in fixtures else UNIT


@cache
def _starts_processes(file: Path) -> bool:
    source = file.read_text(encoding="utf-8")
    return any(name in source for name in STARTS)
