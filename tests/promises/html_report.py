"""The report as a web page, with its pictures inside."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from tests.promises.account import account
from tests.promises.charts import COLORS, LEFT, STYLE, histograms, plain_html, timeline
from tests.promises.findings import HOLDS, UNKNOWN, VIOLATED, Finding, count
from tests.promises.history import ALL, NO_TARGET, History, InjectedFault, Life, target_name
from tests.promises.limits import DURATIONS
from tests.promises.promises import meaning

SHOWN = 10  # pieces of evidence of a promise
WORST_FIRST = (VIOLATED, UNKNOWN, HOLDS)
EFFECT = 5.0  # s after a fault in which the end of a process is its effect, unless another fault follows

PAGE_STYLE = """
body { margin: 0 auto; padding: 32px; max-width: 1240px; background: var(--back); color: var(--text);
  font: 15px/1.5 system-ui, sans-serif; }
h1 { margin: 0; font-size: 26px; } h2 { margin: 36px 0 10px; font-size: 18px; }
p { margin: 4px 0; color: var(--soft); }
.card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 14px 18px;
  overflow-x: auto; }
.chart { display: flex; } .chart > svg { flex: none; }
.chart .names { position: sticky; left: 0; height: auto; background: var(--card);
  box-shadow: -18px 0 var(--card); }
table { border-collapse: collapse; width: 100%; } td, th { padding: 6px 10px; text-align: left;
  border-bottom: 1px solid var(--line); vertical-align: top; } tr:last-child td { border: 0; }
th { color: var(--soft); font-weight: 500; font-size: 13px; }
.number { text-align: right; white-space: nowrap; } .sentence { min-width: 14em; }
.verdict { font-weight: 600; white-space: nowrap; } .holds { color: var(--good); }
.violated { color: var(--bad); } .unknown { color: var(--open); }
.evidence { color: var(--bad); font-size: 13px; }
.chart:focus-visible { outline: 2px solid var(--flow); }
@media (max-width: 900px) {
  body { padding: 16px; overflow-wrap: anywhere; }
  .card { padding: 8px 12px; }
  table, tbody, tr, td { display: block; }
  tr { padding: 8px 0; border-bottom: 1px solid var(--line); } tr:last-child { border: 0; }
  tr:has(th) { display: none; }
  td, td.number { padding: 2px 0; border: 0; text-align: left; } .sentence { min-width: 0; }
  td:is(.inline, .number) { display: inline; padding-right: 12px; }
  td::before { content: attr(data-title) " "; color: var(--soft); font-size: 13px; }
  td:is([data-title=name], [data-title=verdict], [data-title=promise])::before { display: none; }
  td.inline { font-weight: 600; }
}
"""
LEGEND = (
    "The numbers refer to the list of faults. Engines run from an <code>on</code> until an <code>off</code>, "
    "at most for 400 ms. In the row (no target), grey shows when the observer may have missed messages."
)


def verdict(findings: Sequence[Finding]) -> str:
    if broken := [finding.promise for finding in findings if finding.verdict == VIOLATED]:
        return f"{', '.join(broken)} violated"
    open_ = [finding for finding in findings if finding.verdict == UNKNOWN]
    undecided = [finding.promise for finding in open_ if finding.unknown]
    unexercised = [finding.promise for finding in open_ if not finding.unknown]
    if len(unexercised) == len(findings):
        return "No promise was exercised"
    but = [f"the outcome for {', '.join(undecided)} is unknown"] if undecided else []
    but += [f"{', '.join(unexercised)} not exercised"] if unexercised else []
    return f"No promise is violated, but {', and '.join(but)}" if but else "All promises hold"


def html(title: str, remarks: Sequence[str], findings: Sequence[Finding], history: History) -> str:
    picture, *_ = timeline(history, findings)
    ranked = sorted(findings, key=lambda finding: WORST_FIRST.index(finding.verdict))
    lines = [
        "<!doctype html><html lang=en><meta charset=utf-8>",
        "<meta name=viewport content='width=device-width'>",
        f"<title>{plain_html(title)}</title><style>{COLORS}{PAGE_STYLE}{STYLE}</style><main>",
        f"<h1 class={ranked[0].verdict.lower() if ranked else ''}>{verdict(findings)}</h1>",
        f"<h2>Promises</h2><div class=card>{_promises(ranked, history)}</div>",
        f"<h2>Record</h2>{''.join(f'<p>{plain_html(remark)}</p>' for remark in remarks)}",
        f"<h2>Timeline</h2><p>{LEGEND}</p>{_chart(picture, 'timeline')}",
        f"<h2>Faults</h2><div class=card>{_faults(history)}</div>",
    ]
    for finding in findings:
        if finding.times:
            durations = DURATIONS[finding.promise]
            picture = histograms(finding.times, durations.limits)
            lines.append(f"<h2>{durations.title}</h2>{_chart(picture, finding.promise)}")
    return "\n".join(lines) + "\n"


def _chart(picture: str, name: str) -> str:
    """Return a card with a picture that moves sideways, while the names of its rows stay.

    :param name: of the picture in the page.
    """
    width = LEFT - 14  # px: before the first label of the axis
    style = f"width: {width}px; margin-right: -{width}px"
    names = f"<svg class=names style='{style}' aria-hidden=true><use href='#{name}' /></svg>"
    card = f"<div class='card chart' tabindex=0 role=group aria-label={name}>"
    return f"{card}{names}{picture.replace('<svg', f'<svg id={name}', 1)}</div>"


def _promises(findings: Sequence[Finding], history: History) -> str:
    columns = {
        "name": "inline",
        "verdict": "inline",
        "promise": "sentence",
        "measured": "sentence",
        "cases": "number",
        "unknown": "number",
    }
    rows = []
    for finding in findings:
        verdict = f"<span class='verdict {finding.verdict.lower()}'>{finding.verdict}</span>"
        sentence = plain_html(meaning(finding.promise)) + _evidence(finding, history)
        numbers = str(finding.cases), str(finding.unknown)
        rows.append((finding.promise, verdict, sentence, plain_html(finding.summary), *numbers))
    return _table(columns, rows)


def _evidence(finding: Finding, history: History) -> str:
    lines = [f"{e.time:.2f} s: {plain_html(e.words)}" for e in finding.evidence[:SHOWN]]
    if finding.evidence:
        lines[1:1] = [
            f"· {plain_html(each)}" for each in account(history, finding.promise, finding.evidence[0])
        ]
    if (more := len(finding.evidence) - SHOWN) > 0:
        lines.append(f"and {more} more")
    return "".join(f"<div class=evidence>{line}</div>" for line in lines)


def _faults(history: History) -> str:
    columns = {
        "no.": "number",
        "time": "number",
        "fault": "",
        "target": "",
        "duration": "number",
        "hit": "sentence",
    }
    rows = []
    for number, fault in enumerate(history.faults, start=1):
        end = history.effect_end(fault)
        duration = f"{end - fault.begin:.1f} s" if end > fault.begin else "–"
        kind, target = plain_html(fault.kind), plain_html(target_name(fault.target))
        rows.append(
            (str(number), f"{fault.begin:.1f} s", kind, target, duration, plain_html(effect(history, fault)))
        )
    return _table(columns, rows) if rows else "No faults."


def _table(columns: Mapping[str, str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table; ``columns`` has the title and the class of each column."""
    lines = ["<tr>" + "".join(f"<th class='{kind}'>{title}" for title, kind in columns.items())]
    for row in rows:
        cells = zip(columns.items(), row, strict=True)
        found = (f"<td class='{kind}' data-title='{title}'>{cell}" for (title, kind), cell in cells)
        lines.append("<tr>" + "".join(found))
    return f"<table>{''.join(lines)}</table>"


def effect(history: History, fault: InjectedFault) -> str:
    """Return which processes a fault hit and when they ended."""
    hit = [life for life in history.lives if _is_hit(life, fault)]
    later = (other.begin for other in history.faults if other.begin > fault.begin and other.pid == fault.pid)
    until = min([fault.end + EFFECT, *(later if fault.pid else ())])
    ended = [life for life in hit if life.ended is not None and life.ended < until]
    if not hit:
        return "–" if fault.target == NO_TARGET else "no process: the program was restarting"
    if len(hit) > 1:
        return f"{count(len(hit), 'process')}: {len(ended)} ended"
    (life,) = hit
    if not ended or life.ended is None:
        return f"process {life.pid} survived"
    text = f"process {life.pid} ended after {max(0.0, life.ended - fault.begin):.2f} s"
    for successor in history.lives:
        if successor.program == life.program and successor.began > life.ended - 0.02:
            return f"{text}, the next one started {max(0.0, successor.began - life.ended):.2f} s later"
    return text


def _is_hit(life: Life, fault: InjectedFault) -> bool:
    if life.began > fault.begin or (life.ended is not None and life.ended < fault.begin):
        return False
    if fault.target == ALL:
        return (life.program == "") == (fault.kind == "kill_supervisor")
    return (life.program, life.pid) == (fault.target, fault.pid)
