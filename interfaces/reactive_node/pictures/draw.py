"""Draws the pictures of SIGNALS.md with the programs of that page: `python draw.py DIRECTORY`.

The programs (fused.py, speed.py, stop.py) have to be in PYTHONPATH.
"""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

from fused import fused
from speed import speed
from stop import stops

from reactive_node.stamps import stamped
from reactive_node.testing import VirtualTime

WIDTH, HEIGHT, MARGIN = 640, 200, 30  # px
STYLE = """
text { font: 12px system-ui, sans-serif; fill: #6b747b } line { stroke: #98a2a9 }
polyline { stroke-width: 2 }
.a { fill: #2b6ca3; stroke: #2b6ca3 } .b { fill: #e9a23b; stroke: #e9a23b }
.c { fill: #2a8f62; stroke: #2a8f62 } text.a, text.b, text.c { stroke: none } polyline.dim { stroke-width: 1 }
"""
Point = tuple[float, float]


class Picture:
    def __init__(self, times: Point, values: Point) -> None:
        """Show these ranges [s, any unit]."""
        self._times, self._values = times, values
        self._parts: list[str] = []
        self._titles = 0

    def at(self, point: Point) -> Point:
        """Return the place of a time and a value [px]."""
        (begin, end), (low, high) = self._times, self._values
        x = MARGIN + (point[0] - begin) / (end - begin) * (WIDTH - 2 * MARGIN)
        return round(x, 1), round(
            HEIGHT - MARGIN - (point[1] - low) / (high - low) * (HEIGHT - 2 * MARGIN), 1
        )

    def title(self, text: str, kind: str) -> None:
        self._parts.append(f'<text class="{kind}" x="{MARGIN + 200 * self._titles}" y="16">{text}</text>')
        self._titles += 1

    def curve(self, points: Iterable[Point], kind: str) -> None:
        places = " ".join(f"{x:g},{y:g}" for x, y in map(self.at, points))
        self._parts.append(f'<polyline class="{kind}" style="fill:none" points="{places}"/>')

    def dots(self, points: Iterable[Point], kind: str, radius: float = 3.0) -> None:
        places = map(self.at, points)
        self._parts += [f'<circle class="{kind}" cx="{x:g}" cy="{y:g}" r="{radius:g}"/>' for x, y in places]

    def across(self, one: Point, other: Point) -> None:
        (x1, y1), (x2, y2) = self.at(one), self.at(other)
        self._parts.append(f'<line x1="{x1:g}" y1="{y1:g}" x2="{x2:g}" y2="{y2:g}" stroke-dasharray="3 3"/>')

    def save(self, path: Path) -> None:
        axis = f'<line x1="{MARGIN}" y1="{HEIGHT - MARGIN}" x2="{WIDTH - MARGIN}" y2="{HEIGHT - MARGIN}"/>'
        begin, end = self._times
        ends = [
            f'<text x="{x}" y="{HEIGHT - 12}" text-anchor="{anchor}">{time:g} s</text>'
            for x, anchor, time in ((MARGIN, "start", begin), (WIDTH - MARGIN, "end", end))
        ]
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}">'
        lines = [head, f"<style>{STYLE}</style>", axis, *ends, *self._parts, "</svg>"]
        path.write_text("\n".join(lines) + "\n")


def arrivals(scheduler: VirtualTime, items: Sequence[tuple[float, float, object]]) -> object:
    """Return an observable of values, from their times of arrival and measurement [s]."""
    return scheduler.hot(*sorted((at, stamped(value, round(t * 1e9))) for at, t, value in items))


def draw_fused() -> Picture:
    """Draw two topics, and the pairs of values at common times."""
    scheduler, chance = VirtualTime(), random.Random(3)
    inputs = [
        [(t + chance.uniform(0, 0.08), t, value(t)) for t in (k / rate for k in range(1, 3 * rate))]
        for rate, value in (
            (50, lambda t: 1.4 + math.sin(6 * t) / 3),
            (60, lambda t: 0.6 + math.cos(9 * t) / 3),
        )
    ]
    observables = [arrivals(scheduler, each) for each in inputs]
    pairs = [(it.time / 1e9, it.value) for _, it in scheduler.record(fused(*observables), until=3).items]
    picture = Picture((1.0, 2.0), (0.0, 2.0))
    picture.title("position", "a")
    picture.title("current", "b")
    picture.title("pairs at common times", "c")
    for kind, each in zip("ab", inputs, strict=True):
        points = [(t, value) for _, t, value in each if 1.0 <= t <= 2.0]
        picture.curve(points, f"{kind} dim")
        picture.dots(points, kind, 2.0)
    for t, (position, current) in [pair for pair in pairs if 1.0 <= pair[0] <= 2.0]:
        picture.across((t, position), (t, current))
        picture.dots([(t, position), (t, current)], "c", 4.0)
    return picture


def draw_speed() -> Picture:
    """Draw the speed of a signal, and that of the times of arrival."""
    scheduler, chance = VirtualTime(), random.Random(1)
    seen = [
        (t + chance.uniform(0.02, 0.12), t, (2 * math.cos(t), 2 * math.sin(t)))
        for t in (k / 10 for k in range(1, 60))
    ]
    answers = [it for _, it in scheduler.record(speed(arrivals(scheduler, seen)), until=6).items]
    seen.sort()
    naive = [
        (at, math.dist(p, q) / (at - before))
        for (before, _, p), (at, _, q) in pairwise(seen)
        if 1.0 <= at <= 5.0
    ]
    picture = Picture((1.0, 5.0), (0.0, 16.0))
    picture.title("speed by the times of arrival", "b")
    picture.title("speed by the signal (the true one is 2 m/s)", "a")
    picture.curve(naive, "b dim")
    picture.curve([(it.time / 1e9, it.value) for it in answers if 1.0 <= it.time / 1e9 <= 5.0], "a")
    return picture


def draw_stop() -> Picture:
    """Draw a short and a long peak, and the stop."""
    scheduler = VirtualTime()
    times = [k / 50 for k in range(1, 200)]
    measured = [(t + 0.001, t, 90.0 if 1.0 <= t < 1.1 or 2.0 <= t < 2.5 else 70.0) for t in times]
    ((_, stop),) = scheduler.record(stops(arrivals(scheduler, measured), 80.0), until=4).items
    picture = Picture((0.8, 2.8), (60.0, 95.0))
    picture.title("temperature", "a")
    picture.title("stop: 0.2 s above the limit", "c")
    picture.across((0.8, 80.0), (2.8, 80.0))
    picture.curve([(t, value) for _, t, value in measured if 0.8 <= t <= 2.8], "a")
    picture.dots([(stop.nanoseconds / 1e9, 80.0)], "c", 6.0)
    return picture


if __name__ == "__main__":
    directory = Path(sys.argv[1])
    directory.mkdir(exist_ok=True)
    draw_fused().save(directory / "fused.svg")
    draw_speed().save(directory / "speed.svg")
    draw_stop().save(directory / "stop.svg")
