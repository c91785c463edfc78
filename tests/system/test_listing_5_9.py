"""Listing 5.9 of the thesis, end to end: real processes, and the lines that the operator reads.

Virtual time proves each line to the millisecond (tests/component/test_listing_5_9.py). Real processes also
wait for their machine. When it stands still for a moment, a few lines come late, and DDS keeps only the last
of the equal values that came meanwhile. So this test judges the typical line of each kind, and equal values
in a row as one.
"""

from __future__ import annotations

import itertools
import math
import re
import statistics
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.sites import Site

LISTING = Path(__file__).with_name("listing_5_9.txt").read_text()
SPEED = "Speed: # [m/s]"
NUMBER = r"-?\d+(?:\.\d+)?"
TOLERANCE = 0.1  # s by which the typical time between lines of two kinds may differ from the thesis
JITTER = 0.02  # s between the stamp of a position and its publication, on a busy machine


def lines(output: str) -> Iterator[tuple[float, str, list[float]]]:
    """The time [s], the words and the numbers of each line, in order."""
    for time, text in re.findall(r"^\[(-?\d+)\] (.*)$", output, re.MULTILINE):
        numbers = [float(number) for number in re.findall(NUMBER, text)]
        yield int(time) / 1000, re.sub(NUMBER, "#", text), numbers


def by_words(output: str) -> dict[str, list[tuple[float, list[float]]]]:
    grouped: dict[str, list[tuple[float, list[float]]]] = defaultdict(list)
    for time, words, numbers in lines(output):
        grouped[words].append((time, numbers))
    return grouped


@pytest.mark.alone
def test_the_operator_reads_what_the_thesis_shows(site: Site) -> None:
    command = site.begin("run", "listing_5_9")
    command.await_line("Turning off engines", 60)
    command.type("quit\n")
    assert command.wait() == 0

    shown, listing = by_words(command.output), by_words(LISTING)
    shown.pop("Engines are off, not turned on since engine_controller started")  # not in the thesis
    assert shown.keys() == listing.keys()
    speeds_fit_their_positions(command.output)
    typical = {}
    for words in listing.keys() - {SPEED}:
        changed, expected = changes(shown[words]), changes(listing[words])
        assert [numbers for _, numbers in changed] == [numbers for _, numbers in expected], command.output
        if len(expected) > 1:
            pairs = zip(changed, expected, strict=True)
            typical[words] = statistics.median(time - listed for (time, _), (listed, _) in pairs)
    assert max(typical.values()) - min(typical.values()) <= TOLERANCE, typical


def changes(some: list[tuple[float, list[float]]]) -> list[tuple[float, list[float]]]:
    """The lines without equal numbers in a row; all lines, if they have no numbers."""
    return [next(equal) for _, equal in itertools.groupby(some, key=lambda line: line[1] or line[0])]


def speeds_fit_their_positions(output: str) -> None:
    """Assert that a speed is a distance by the time that has really passed."""
    positions: list[tuple[float, list[float]]] = []
    for time, words, numbers in lines(output):
        if words.startswith("Position"):
            positions.append((time, numbers))
        elif words == SPEED:
            (before, start), (after, end) = positions[-2:]
            (speed,) = numbers
            assert math.dist(start, end) == pytest.approx(speed * (after - before), abs=speed * JITTER + 1e-4)
