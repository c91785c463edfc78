"""Listing 5.9 of the thesis, end to end: real processes, and what the operator reads."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import pytest

from tests.system.sites import Site

LISTING = Path(__file__).with_name("listing_5_9.txt").read_text()
SAME = 0.1  # s by which distances between lines may differ from the thesis'


def by_kind(output: str) -> dict[str, list[tuple[float, list[float]]]]:
    """The lines as the thesis has them: by their words, the time [s] and the numbers of each."""
    kinds: dict[str, list[tuple[float, list[float]]]] = defaultdict(list)
    for time, text in re.findall(r"^\[(-?\d+)\] (.*)$", output, re.MULTILINE):
        numbers = [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", text)]
        kinds[re.sub(r"-?\d+(?:\.\d+)?", "#", text)].append((int(time) / 1000, numbers))
    return kinds


@pytest.mark.timeout(90)
def test_the_operator_reads_what_the_thesis_shows(site: Site) -> None:
    command = site.begin("run", "listing_5_9")
    command.await_line("Turning off engines", 60)
    command.type("quit\n")
    assert command.wait() == 0

    shown, listing = by_kind(command.output), by_kind(LISTING)
    shown.pop("Engines are off")  # the thesis' engines say nothing
    assert {kind: len(lines) for kind, lines in shown.items()} == {
        kind: len(lines) for kind, lines in listing.items()
    }
    deviations = []
    for kind, lines in listing.items():
        # A speed is a distance by the time that has really passed.
        tolerance = 0.05 if kind.startswith("Speed") else 0.0
        for (time, numbers), (listed, expected) in zip(shown[kind], lines, strict=True):
            assert numbers == pytest.approx(expected, rel=tolerance, abs=0)
            deviations.append(time - listed)
    assert max(deviations) - min(deviations) <= SAME
