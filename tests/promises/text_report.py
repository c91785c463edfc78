"""The report in the terminal: a line for each promise, the evidence, and the durations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from deploy.supervision.columns import table
from tests.promises.account import account
from tests.promises.findings import VIOLATED, Finding, percentile
from tests.promises.history import History
from tests.promises.limits import DURATIONS
from tests.promises.promises import meaning

SHOWN = 5  # pieces of evidence of a promise
HEADER = ("", "PROMISE", "VERDICT", "CASES", "UNKNOWN", "MEASURED")
DURATIONS_HEADER = ("", "SERVICE", "CASES", "P50", "P99")


def text(findings: Sequence[Finding], history: History | None = None) -> str:
    """Return the report.

    :param history: from which it shows what led to the first violation of each promise.
    """
    blocks = [table([HEADER, *(_row(finding) for finding in findings)])]
    for finding in findings:
        if finding.verdict == VIOLATED:
            lines = [f"  at {e.time:.2f} s: {e.words}" for e in finding.evidence[:SHOWN]]
            if history:
                lines[1:1] = [
                    f"    {each}" for each in account(history, finding.promise, finding.evidence[0])
                ]
            if (more := len(finding.evidence) - SHOWN) > 0:
                lines.append(f"  and {more} more")
            blocks.append("\n".join([f"{finding.promise} is violated:", *lines]))
    for finding in findings:
        if finding.times:
            rows = table([DURATIONS_HEADER, *_durations(finding)])
            blocks.append(f"{DURATIONS[finding.promise].title}\n{rows}")
    return "\n\n".join(blocks)


def _durations(finding: Finding) -> Iterator[tuple[str, ...]]:
    """Yield the percentiles of a finding's durations, a row for each program."""
    for program, values in finding.times.items():
        yield "", program, str(len(values)), f"{percentile(values, 50):.2f}", f"{percentile(values, 99):.2f}"


def _row(finding: Finding) -> tuple[str, ...]:
    return (
        finding.promise,
        meaning(finding.promise),
        finding.verdict,
        str(finding.cases),
        str(finding.unknown),
        finding.summary,
    )
