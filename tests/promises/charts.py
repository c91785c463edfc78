"""Pictures of a record as SVG: the timeline of an arm, and histograms of durations.

`tests/chaos/example.svg` is the `report.svg` of an older `make chaos CHAOS="--scenario variously"`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from html import escape

from interfaces.plain_text import plain
from tests.promises.findings import VIOLATED, Finding, percentile
from tests.promises.history import (
    ALL,
    LOSS,
    NO_TARGET,
    OUTPUTS,
    OVERLOAD,
    History,
    InjectedFault,
    Sample,
    running,
    target_name,
)

LEFT, ROW, BAR = 150, 26, 14  # px: names of rows, rows, bars
PER_SECOND, PER_SECOND_LONG, NARROWEST = 8.0, 3.0, 1000.0  # px of a timeline
LONG = 240.0  # s; a longer timeline is drawn at a smaller scale
CHARACTER = 6.0  # px
TOP, HISTOGRAM, BIN = 10, 140, 0.1  # px, px, s of a histogram
SHORT_AXIS, LONG_AXIS = 2.2, 5.2  # s

COLORS = """
:root { color-scheme: light dark; --back: #fbfbf9; --text: #1d2327; --soft: #626b72; --line: #d9dcd8;
  --card: #fff; --good: #1f7a51; --bad: #c23434; --open: #856313; --one: #b9d3ea; --two: #8fb6da;
  --flow: #2b6ca3; --lasting: #e9a23b; --on: #2a8f62; }
@media (prefers-color-scheme: dark) { :root { --back: #14181b; --text: #e4e7e9; --soft: #98a2a9;
  --line: #333b41; --card: #1b2024; --good: #4cc38a; --bad: #ff6b6b; --open: #e0b354; --one: #2d4a63;
  --two: #3f6688; --flow: #8cc4f5; --lasting: #e9a23b; --on: #4cc38a; } }
"""
STYLE = """
svg text { font: 12px system-ui, sans-serif; fill: var(--text); } svg .soft { fill: var(--soft); }
svg .mark { paint-order: stroke; stroke: var(--card); stroke-width: 3px; }
svg .title { font-size: 14px; font-weight: 600; }
svg .figures { white-space: pre; }
svg .grid { stroke: var(--line); } svg .bound { stroke: var(--bad); stroke-dasharray: 4 3; }
svg .card { fill: var(--card); stroke: var(--line); }
.one { fill: var(--one); } .two { fill: var(--two); } .flow { fill: var(--flow); } .on { fill: var(--on); }
.missed { fill: var(--soft); } .momentary { fill: var(--bad); }
.lasting { fill: var(--lasting); fill-opacity: .55; }
"""

SUPERVISORD = "supervisord"
ROWS = ("operator", "engines", target_name(NO_TARGET), SUPERVISORD)
"""The rows above those of the programs."""


def plain_html(text: str) -> str:
    """Return a text of others in the same way as :func:`plain`, for HTML and SVG."""
    return escape(plain(text))


def framed(picture: str, width: float, height: float, title: str) -> str:
    """Return an SVG file with a picture and a title, on a card that suits light and dark pages."""
    margin, heading = 16, 30
    outer_width, outer_height = width + 2 * margin, height + 2 * margin + heading
    content = [
        _tag("style", COLORS + STYLE),
        _tag("rect", class_="card", x=0.5, y=0.5, width=outer_width - 1, height=outer_height - 1, rx=8),
        _tag("text", plain_html(title), class_="title", x=margin, y=margin + 12),
        _tag("g", picture, transform=f"translate({margin} {margin + heading})"),
    ]
    return _svg(outer_width, outer_height, title, content) + "\n"


def timeline(history: History, findings: Sequence[Finding] = ()) -> tuple[str, float, float]:
    """Return the timeline of an arm as SVG, with its width and height [px].

    A row for each program shows its processes, its output and its faults. Lines across all rows show the
    evidence of violated promises.
    """
    scale = PER_SECOND if history.end < LONG else PER_SECOND_LONG
    scale = max(scale, (NARROWEST - LEFT) / max(history.end, 1.0))
    rows = *ROWS, *history.programs
    axis = ROW * len(rows)
    width, height = LEFT + scale * history.end + 20, axis + 2 * ROW

    def x(time: float) -> float:
        return LEFT + scale * min(max(time, 0.0), history.end)

    parts = []
    step = next(s for s in (5, 10, 30, 60, 120, math.inf) if s * scale >= 60)
    for time in range(0, int(history.end) + 1, int(step)):
        parts.append(_tag("line", class_="grid", x1=x(time), x2=x(time), y1=0, y2=axis))
        label = _tag("text", f"{time} s", class_="soft", x=x(time), y=axis + 18, text_anchor="middle")
        parts.append(label)
    for number, row in enumerate(rows):
        top = number * ROW + 4
        parts.append(_tag("text", row, x=0, y=top + 12))
        for begin, end, kind, offset, tall in _bars(history, row):
            bar_width = max(0.7, x(end) - x(begin))
            bar = _tag("rect", class_=kind, x=x(begin), y=top + offset, width=bar_width, height=tall, rx=1)
            parts.append(bar)
        parts += _marks(history, row, x, top)
    for finding in findings:
        for evidence in finding.evidence:
            tip = _tag("title", plain_html(f"{finding.promise}: {evidence.words}"))
            at = x(evidence.time)
            parts.append(_tag("line", tip, class_="bound", x1=at, x2=at, y1=0, y2=axis))
    parts += _legend(axis + ROW + 8, history, findings)
    return _svg(width, height, "timeline", parts), width, height


def _bars(history: History, row: str) -> Iterator[tuple[float, float, str, int, int]]:
    """Yield begin, end, class, offset and height of each bar in a row."""
    if row == "operator":
        yield from ((b, e, "flow", 0, BAR) for b, e in _flow(history.signs_of_life(), 0.25))
    elif row == "engines":
        yield from ((b, e, "on", 0, BAR) for b, e in _joined(running(history)))
    elif row == target_name(NO_TARGET):
        missed = (each for each in history.conditions if each.kind in (OVERLOAD, LOSS))
        yield from ((each.begin, each.end, "missed", 0, BAR) for each in missed)
    else:
        program = "" if row == SUPERVISORD else row
        for number, life in enumerate(life for life in history.lives if life.program == program):
            end = history.end if life.ended is None else life.ended
            yield life.began, end, ("one", "two")[number % 2], 0, BAR
        if program:
            longest_gap = OUTPUTS[program].longest_gap if program in OUTPUTS else 1.0
            yield from ((b, e, "flow", BAR + 1, 3) for b, e in _flow(history.output(program), longest_gap))


def _joined(intervals: Iterable[tuple[float, float]]) -> Iterator[tuple[float, float]]:
    last: tuple[float, float] | None = None
    for begin, end in intervals:
        if last and last[1] == begin:
            last = (last[0], end)
            continue
        if last:
            yield last
        last = (begin, end)
    if last:
        yield last


def _flow(samples: Sequence[Sample], longest_gap: float) -> Iterator[tuple[float, float]]:
    """Yield the intervals in which messages follow each other, with some tolerance."""
    pairs = itertools.pairwise(sample.sent for sample in samples)
    return _joined((one, two) for one, two in pairs if two - one <= 0.4 + 1.2 * longest_gap)


def _marks(history: History, row: str, x: Callable[[float], float], top: int) -> Iterator[str]:
    """Yield the faults of a row, each with its number and, where there is room, its kind."""
    faults = [each for each in enumerate(history.faults, start=1) if row in _rows(history, each[1])]
    places = [*(x(fault.begin) for _, fault in faults), math.inf]
    for (number, fault), left, following in zip(faults, places, places[1:], strict=False):
        if (end := history.effect_end(fault)) - fault.begin >= 0.1:
            width = x(end) - left
            yield _tag("rect", class_="lasting", x=left, y=top, width=width, height=BAR)
        yield _tag("path", class_="momentary", d=f"M{left - 4:.1f} {top - 3}h8l-4 7z")
        label = f"{number} {fault.kind}"
        if CHARACTER * len(label) + 8 > following - left:
            label = str(number)
        yield _tag("text", plain_html(label), class_="mark", x=left + 5, y=top + 11)


def _rows(history: History, fault: InjectedFault) -> Sequence[str]:
    if fault.kind == "kill_supervisor":
        return (SUPERVISORD,)
    return history.programs if fault.target == ALL else (target_name(fault.target),)


def _legend(y: float, history: History, findings: Sequence[Finding]) -> Iterator[str]:
    symbols = [
        ("flow", "output flows"),
        ("one", "one process"),
        ("two", "its successor"),
        ("on", "engines on"),
        ("momentary", "fault"),
        ("lasting", "lasting fault"),
    ]
    if any(each.kind in (OVERLOAD, LOSS) for each in history.conditions):
        symbols.append(("missed", "record may be incomplete"))
    if any(finding.verdict == VIOLATED for finding in findings):
        symbols.append(("bound", "promise violated"))
    left = float(LEFT)
    for kind, text in symbols:
        if kind == "momentary":
            yield _tag("path", class_=kind, d=f"M{left:.1f} {y}h8l-4 7z")
        elif kind == "bound":
            yield _tag("line", class_=kind, x1=left, x2=left + 16, y1=y + 4, y2=y + 4)
        else:
            yield _tag("rect", class_=kind, x=left, y=y, width=16, height=3 if kind == "flow" else 8)
        yield _tag("text", text, class_="soft", x=left + 22, y=y + 8)
        left += 44 + CHARACTER * len(text)


def histograms(durations: dict[str, list[float]], bounds: Sequence[float]) -> str:
    """Return a histogram of all durations [s], with a row of dots for each program, as SVG."""
    every = [time for values in durations.values() for time in values if math.isfinite(time)]
    axis = SHORT_AXIS if max([*every, *bounds]) <= SHORT_AXIS else LONG_AXIS
    right = LEFT + 820.0
    bottom = TOP + HISTOGRAM
    height = bottom + 40 + ROW * len(durations)

    def x(time: float) -> float:
        return LEFT + (right - LEFT) * min(time, axis) / axis

    parts = []
    for half_seconds in range(int(axis / 0.5) + 1):
        at = x(half_seconds / 2)
        parts.append(_tag("line", class_="grid", x1=at, x2=at, y1=TOP, y2=height))
        tick = f"{half_seconds / 2:g} s"
        parts.append(_tag("text", tick, class_="soft", x=at, y=bottom + 16, text_anchor="middle"))
    parts += _histogram(every, x, axis)
    parts.append(_tag("text", f"all ({len(every)})", x=0, y=TOP + 14))
    header = "cases   p50   p99   worst"
    parts.append(_tag("text", header, class_="soft figures", x=right + 12, y=bottom + 16))
    parts += [_tag("line", class_="bound", x1=x(b), x2=x(b), y1=TOP, y2=height) for b in bounds]
    for number, (program, values) in enumerate(sorted(durations.items())):
        middle = bottom + 42 + ROW * number
        parts.append(_tag("text", plain_html(program), x=0, y=middle + 4))
        parts += [_tag("circle", class_="flow", fill_opacity=0.5, cx=x(v), cy=middle, r=4) for v in values]
        median, slow = (f"{percentile(values, p):.2f}" for p in (50, 99))
        summary = f"{len(values)}   {median}   {slow}   {max(values):.2f}"
        parts.append(_tag("text", summary, class_="figures", x=right + 12, y=middle + 4))
    return _svg(right + 190, height, "histogram", parts)


def _histogram(values: Sequence[float], x: Callable[[float], float], axis: float) -> Iterator[str]:
    counts = [0] * (int(axis / BIN) + 1)
    for value in values:
        counts[min(int(value / BIN), len(counts) - 1)] += 1
    for number, count in enumerate(counts):
        if count:
            tall = HISTOGRAM * count / max(counts)
            left, width = x(number * BIN) + 0.5, x(BIN) - LEFT - 1
            place = {"x": left, "y": TOP + HISTOGRAM - tall, "width": width, "height": tall}
            yield _tag("rect", _tag("title", str(count)), class_="two", **place)


def _svg(width: float, height: float, label: str, parts: Sequence[str]) -> str:
    size = {"width": math.ceil(width), "height": math.ceil(height)}
    namespace = "http://www.w3.org/2000/svg"
    return _tag("svg", "".join(parts), xmlns=namespace, role="img", aria_label=plain_html(label), **size)


def _tag(name: str, content: str = "", **attributes: str | float) -> str:
    """Return an XML element; ``class_`` stands for ``class``, ``_`` in other names for ``-``."""
    words = [name]
    for key, value in attributes.items():
        text = value if isinstance(value, str) else f"{round(value, 1):g}"
        words.append(f'{key.rstrip("_").replace("_", "-")}="{text}"')
    return f"<{' '.join(words)}>{content}</{name}>" if content else f"<{' '.join(words)} />"
