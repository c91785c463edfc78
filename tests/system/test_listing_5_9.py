"""Listing 5.9 of the thesis, end to end: real processes, and the lines that the operator reads."""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.system.sites import Site

LISTING = Path(__file__).with_name("listing_5_9.txt").read_text()
NUMBER = r"-?\d+(?:\.\d+)?"
TOLERANCE = 0.1  # s by which the time between lines may differ from the thesis
JITTER = 0.02  # s between the stamp of a position and its publication, on a busy machine


def lines(output: str) -> Iterator[tuple[float, str, list[float]]]:
    """The time [s], the words and the numbers of each line, in order."""
    for time, text in re.findall(r"^\[(-?\d+)\] (.*)$", output, re.MULTILINE):
        numbers = [float(number) for number in re.findall(NUMBER, text)]
        yield int(time) / 1000, re.sub(NUMBER, "#", text), numbers


def by_words(output: str) -> dict[str, list[tuple[float, list[float]]]]:
    """The times and numbers of the lines with the same words."""
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
    shown.pop("Engines are off")  # not in the thesis
    assert {words: len(some) for words, some in shown.items()} == {
        words: len(some) for words, some in listing.items()
    }
    deviations: dict[str, list[float]] = defaultdict(list)
    for words, expected in listing.items():
        for (time, numbers), (listed_time, listed_numbers) in zip(shown[words], expected, strict=True):
            deviations[words].append(time - listed_time)
            assert numbers == listed_numbers or words.startswith("Speed")
    every = [each for some in deviations.values() for each in some]
    assert max(every) - min(every) <= TOLERANCE, deviations
    speeds_fit_their_positions(command.output)


def speeds_fit_their_positions(output: str) -> None:
    """Assert that a speed is a distance by the time that has really passed."""
    positions: list[tuple[float, list[float]]] = []
    for time, words, numbers in lines(output):
        if words.startswith("Position"):
            positions.append((time, numbers))
        elif words.startswith("Speed"):
            (before, start), (after, end) = positions[-2:]
            (speed,) = numbers
            assert math.dist(start, end) == pytest.approx(speed * (after - before), abs=speed * JITTER + 1e-4)
