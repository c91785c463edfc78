"""The report as a web page: self-contained, with the pictures drawn as SVG in it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape

from deploy.chaos.findings import UNKNOWN, VIOLATED, Finding, percentile
from deploy.chaos.history import ALL, CIRCUMSTANCES, LOSS, NOTHING, OVERLOAD, PROGRAMS, Fault, History
from deploy.chaos.liveness import HUNG, MEDIAN, SLOWEST
from deploy.chaos.promises import meaning
from deploy.chaos.report import TIMES
from deploy.chaos.safety import running

LEFT, ROW, BAR = 150, 26, 14  # px: labels, rows, bars
PER_SECOND, NARROWEST = 8.0, 1000.0  # px of a timeline
OTHERS = "others"  # the row of what must not disturb anybody
FLOW = 0.6  # s without a message that make a hole in a stream
BIN = 0.1  # s
LONGEST = 5.2  # s, the end of the histograms' axis

STYLE = """
:root { color-scheme: light dark; --back: #fbfbf9; --text: #1d2327; --soft: #6b747b; --line: #d9dcd8;
  --card: #fff; --good: #2a8f62; --bad: #cf3d3d; --open: #a9812b; --one: #b9d3ea; --two: #8fb6da;
  --flow: #2b6ca3; --lasting: #e9a23b; --on: #2a8f62; }
@media (prefers-color-scheme: dark) { :root { --back: #14181b; --text: #e4e7e9; --soft: #98a2a9;
  --line: #333b41; --card: #1b2024; --good: #4cc38a; --bad: #ff6b6b; --open: #e0b354; --one: #2d4a63;
  --two: #3f6688; --flow: #8cc4f5; --lasting: #e9a23b; --on: #4cc38a; } }
body { margin: 0 auto; padding: 32px; max-width: 1240px; background: var(--back); color: var(--text);
  font: 15px/1.5 system-ui, sans-serif; }
h1 { margin: 0; font-size: 26px; } h2 { margin: 36px 0 10px; font-size: 18px; }
p { margin: 4px 0; color: var(--soft); }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 14px 18px;
  overflow-x: auto; }
table { border-collapse: collapse; width: 100%; } td, th { padding: 6px 10px; text-align: left;
  border-bottom: 1px solid var(--line); vertical-align: top; } tr:last-child td { border: 0; }
th { color: var(--soft); font-weight: 500; font-size: 13px; } td.number { text-align: right; }
.verdict { font-weight: 600; white-space: nowrap; } .holds { color: var(--good); }
.violated { color: var(--bad); } .unknown { color: var(--open); }
.evidence { color: var(--bad); font-size: 13px; }
svg text { font: 12px system-ui, sans-serif; fill: var(--text); } svg .soft { fill: var(--soft); }
svg .grid { stroke: var(--line); } svg .bound { stroke: var(--bad); stroke-dasharray: 4 3; }
.one { fill: var(--one); } .two { fill: var(--two); } .flow { fill: var(--flow); } .on { fill: var(--on); }
.missed { fill: var(--soft); } .kill { fill: var(--bad); }
.lasting { fill: var(--lasting); fill-opacity: .55; }
"""


def page(title: str, remarks: Sequence[str], findings: Sequence[Finding], history: History) -> str:
    """The whole page."""
    broken = [finding.promise for finding in findings if finding.verdict == VIOLATED]
    verdict = f"{', '.join(broken)} violated" if broken else "All promises hold that were put to the test"
    lines = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width'>",
        f"<title>{escape(title)}</title><style>{STYLE}</style>",
        f"<h1 class={'violated' if broken else 'holds'}>{verdict}</h1>",
        *(f"<p>{escape(remark)}</p>" for remark in remarks),
        f"<h2>Promises</h2><div class=card>{_promises(findings)}</div>",
        f"<h2>What happened</h2><p>{LEGEND}</p><div class=card>{timeline(history, findings)}</div>",
    ]
    for finding in findings:
        if finding.times:
            bounds = (MEDIAN, SLOWEST) if finding.promise == "L1" else (HUNG,)
            lines += [
                f"<h2>{TIMES[finding.promise]}</h2>",
                f"<div class=card>{histograms(finding.times, bounds)}</div>",
            ]
    return "\n".join(lines) + "\n"


LEGEND = (
    "Each row shows the processes of a program, one after the other, and below them whether its output "
    "flows. Red triangles are faults of a moment, amber bars those that last. Engines run from an `on` until "
    "an `off`, or for 400 ms. Grey among the others: the observer may have missed something. Dashed red "
    "lines: where a promise was broken."
)


def _promises(findings: Sequence[Finding]) -> str:
    rows = ["<tr><th><th>promise<th>verdict<th>cases<th>unknown<th>figures"]
    for finding in findings:
        evidence = "".join(
            f"<div class=evidence>{e.time:.2f} s: {escape(e.what)}</div>" for e in finding.evidence[:10]
        )
        figures = escape(finding.figures) if finding.verdict != UNKNOWN else "not put to the test"
        rows.append(
            f"<tr><td>{finding.promise}<td>{escape(meaning(finding.promise))}{evidence}"
            f"<td class='verdict {finding.verdict.lower()}'>{finding.verdict}"
            f"<td class=number>{finding.cases}<td class=number>{finding.unknown}<td>{figures}"
        )
    return f"<table>{''.join(rows)}</table>"


def timeline(history: History, findings: Sequence[Finding] = ()) -> str:
    """
    All programs over time: processes, output, faults; on top of them the operator and the engines.

    Lines across all rows show where the evidence of violated promises is.
    """
    scale = max(PER_SECOND if history.end < 240 else 3.0, (NARROWEST - LEFT) / max(history.end, 1.0))
    rows = ["operator", "engines", OTHERS, "supervisord", *PROGRAMS]
    height = ROW * (len(rows) + 1)
    width = LEFT + scale * history.end + 20

    def x(time: float) -> float:
        return LEFT + scale * min(max(time, 0.0), history.end)

    parts = [f"<svg width={width:.0f} height={height} role=img aria-label='timeline'>"]
    step = next(s for s in (5, 10, 30, 60, 120) if s * scale >= 60)
    for time in range(0, int(history.end) + 1, step):
        parts.append(f"<line class=grid x1={x(time):.1f} x2={x(time):.1f} y1=0 y2={height - ROW} />")
        parts.append(f"<text class=soft x={x(time):.1f} y={height - 8} text-anchor=middle>{time} s</text>")
    for number, row in enumerate(rows):
        top = number * ROW + 4
        parts.append(f"<text x=0 y={top + 12}>{row}</text>")
        for begin, end, kind, offset, tall in _bars(history, row):
            parts.append(
                f"<rect class={kind} x={x(begin):.1f} y={top + offset} height={tall} rx=1 "
                f"width={max(0.7, x(end) - x(begin)):.1f} />"
            )
        parts += [_mark(fault, x, top) for fault in history.faults if _row_of(fault, row)]
    for finding in findings:
        for evidence in finding.evidence:
            tip = f"<title>{finding.promise}: {escape(evidence.what)}</title>"
            at = x(evidence.time)
            parts.append(f"<line class=bound x1={at:.1f} x2={at:.1f} y1=0 y2={height - ROW}>{tip}</line>")
    return "".join(parts) + "</svg>"


def _bars(history: History, row: str) -> Iterator[tuple[float, float, str, int, int]]:
    """Begin, end, class, offset and height of what a row shows."""
    if row == "operator":
        yield from ((b, e, "flow", 0, BAR) for b, e in _stretches(_times(history, "dead_mans_switch")))
        return
    if row == "engines":
        yield from ((b, e, "on", 0, BAR) for b, e in running(history))
        return
    if row == OTHERS:
        blind = (f for f in history.faults if f.kind in (OVERLOAD, LOSS))
        yield from ((f.begin, f.end, "missed", 0, BAR) for f in blind)
        return
    program = "" if row == "supervisord" else row
    lives = [life for life in history.lives if life.program == program]
    for number, life in enumerate(lives):
        end = history.end if life.ended is None else life.ended
        yield life.began, end, ("one", "two")[number % 2], 0, BAR
    if program:
        yield from ((b, e, "flow", BAR + 1, 3) for b, e in _stretches(_times(history, program)))


def _times(history: History, program: str) -> list[float]:
    return [s.sent for s in history.output(program)]


def _stretches(times: Sequence[float]) -> Iterator[tuple[float, float]]:
    """Where times are dense."""
    if not times:
        return
    rare = len(times) < 2 or (times[-1] - times[0]) / len(times) > FLOW / 3
    hole = 1.6 if rare else FLOW  # health and presence come once or twice a second
    begin = last = times[0]
    for time in times[1:]:
        if time - last > hole:
            yield begin, last
            begin = time
        last = time
    yield begin, last


def _row_of(fault: Fault, row: str) -> bool:
    if fault.kind in CIRCUMSTANCES:
        return False
    if fault.target == row:
        return True
    if fault.target == ALL:
        return row == "supervisord" if fault.kind == "kill_supervisor" else row in PROGRAMS
    return row == OTHERS and fault.target == NOTHING


def _mark(fault: Fault, x: object, top: int) -> str:
    assert callable(x)
    left = x(fault.begin)
    tip = f"<title>{escape(fault.kind)} {escape(fault.target)} at {fault.begin:.2f} s</title>"
    triangle = f"<path class=kill d='M{left - 4:.1f} {top - 3}h8l-4 7z'>{tip}</path>"
    if fault.end - fault.begin < 0.1:
        return triangle
    width = x(fault.end) - left
    return f"<rect class=lasting x={left:.1f} y={top} width={width:.1f} height={BAR}>{tip}</rect>{triangle}"


def histograms(times: dict[str, list[float]], bounds: Sequence[float]) -> str:
    """How long each program was silent: a histogram for all, a row of dots for each."""
    every = [time for values in times.values() for time in values if math.isfinite(time)]
    longest = LONGEST if max(every, default=0.0) > 2.2 or max(bounds) > 2.2 else 2.2
    width, tall = 820.0, 140
    right = LEFT + width
    counts = [0] * (int(longest / BIN) + 1)
    for time in every:
        counts[min(int(time / BIN), len(counts) - 1)] += 1
    top, bottom = 10, tall + 10
    rows = bottom + 34
    height = rows + ROW * len(times) + 6

    def x(time: float) -> float:
        return LEFT + width * min(time, longest) / longest

    parts = [f"<svg width={right + 190:.0f} height={height} role=img aria-label='histogram'>"]
    for tick in range(int(longest / 0.5) + 1):
        at = x(tick / 2)
        parts.append(f"<line class=grid x1={at:.1f} x2={at:.1f} y1={top} y2={height} />")
        parts.append(f"<text class=soft x={at:.1f} y={bottom + 16} text-anchor=middle>{tick / 2:g} s</text>")
    for number, count in enumerate(counts):
        if count:
            bar = tall * count / max(counts)
            parts.append(
                f"<rect class=two x={x(number * BIN) + 0.5:.1f} y={bottom - bar:.1f} height={bar:.1f} "
                f"width={x(BIN) - LEFT - 1:.1f}><title>{count}</title></rect>"
            )
    parts.append(f"<text x=0 y={top + 14}>all ({len(every)})</text>")
    parts.append(f"<text x={right + 12:.0f} y={bottom + 16} class=soft>cases   p50   p99   worst</text>")
    for bound in bounds:
        parts.append(f"<line class=bound x1={x(bound):.1f} x2={x(bound):.1f} y1={top} y2={height} />")
    for number, (program, values) in enumerate(sorted(times.items())):
        middle = rows + ROW * number + 8
        parts.append(f"<text x=0 y={middle + 4}>{escape(program)}</text>")
        parts += [f"<circle class=flow fill-opacity=.5 cx={x(v):.1f} cy={middle} r=4 />" for v in values]
        median, slow = (f"{percentile(values, p):.2f}" for p in (50, 99))
        summary = f"{len(values)}   {median}   {slow}   {max(values):.2f}"
        parts.append(f"<text xml:space=preserve x={right + 12:.0f} y={middle + 4}>{summary}</text>")
    return "".join(parts) + "</svg>"
