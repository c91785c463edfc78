"""The verdict in the terminal: a line for each promise, the evidence, and recovery times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from deploy.chaos.findings import UNKNOWN, VIOLATED, Finding, percentile
from deploy.chaos.promises import meaning
from deploy.commands.status import table

SHOWN = 5  # pieces of evidence of a promise
HEADER = ("", "PROMISE", "VERDICT", "CASES", "UNKNOWN", "FIGURES")


def text(findings: Sequence[Finding]) -> str:
    """Everything that an engineer wants to know at first."""
    blocks = [table([HEADER, *(_row(finding) for finding in findings)])]
    for finding in findings:
        if finding.verdict == VIOLATED:
            lines = [f"  at {e.time:.2f} s: {e.what}" for e in finding.evidence[:SHOWN]]
            if (more := len(finding.evidence) - SHOWN) > 0:
                lines.append(f"  and {more} times more")
            blocks.append("\n".join([f"{finding.promise} is violated:", *lines]))
    for finding, title in ((f, t) for f in findings for p, t in TIMES.items() if f.promise == p and f.times):
        blocks.append(title + "\n" + table([TIMES_HEADER, *times(finding)]))
    return "\n\n".join(blocks)


TIMES = {"L1": "Silent after SIGKILL [s]", "L4": "Silent after a hang [s]"}
"""The promises about durations, and what these are."""
TIMES_HEADER = ("", "SERVICE", "CASES", "P50", "P99")


def times(finding: Finding) -> Iterable[tuple[str, ...]]:
    """The percentiles of a finding's durations, a row for each program."""
    for program, values in finding.times.items():
        yield "", program, str(len(values)), f"{percentile(values, 50):.2f}", f"{percentile(values, 99):.2f}"


def _row(finding: Finding) -> tuple[str, ...]:
    return (
        finding.promise,
        meaning(finding.promise),
        finding.verdict,
        str(finding.cases),
        str(finding.unknown),
        "not put to the test" if finding.verdict == UNKNOWN else finding.figures,
    )
