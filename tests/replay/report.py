"""The result of a replay as lines of text."""

from __future__ import annotations

from collections.abc import Sequence

from rclpy_simulation.host import SECOND

from tests.replay.comparison import Comparison, Difference
from tests.replay.job import Outcome
from tests.replay.record import Record

SHOWN = 3  # differences of each topic
_TITLES = ("topic", "recorded", "replayed", "differ", "value by", "time by", "", "bounds")
HEAD = "{:24} {:>9} {:>9} {:>7} {:>11} {:>9}  {:9}  {}".format(*_TITLES)


def report(record: Record, outcomes: Sequence[Outcome]) -> tuple[list[str], bool | None]:
    """Return the result as text, and whether the output equals the recorded one; ``None`` if unknown."""
    lines, differing = [record.remark] if record.remark else [], []
    namespaces = list(dict.fromkeys(outcome.job.namespace for outcome in outcomes))
    lines.append(HEAD)
    for outcome in outcomes:
        prefix = f"{outcome.job.namespace} " if len(namespaces) > 1 else ""
        for comparison in outcome.comparisons:
            lines.append(_row(prefix, comparison))
            if not comparison.is_equal:
                differing.append(prefix + comparison.topic)
                lines += [f"    {_shown(record, each)}" for each in comparison.differences[:SHOWN]]
        for time, reason in outcome.failures:
            differing.append(prefix + reason)
            lines.append(f"    at {_seconds(record, time)}: {prefix}{reason}")
    length = (record.end - record.begin) / SECOND
    if differing:
        lines.append(f"Different in {length:.0f} s: {', '.join(differing)}")
        return lines, False
    if not any(comparison.compared for outcome in outcomes for comparison in outcome.comparisons):
        lines.append(f"Nothing can be compared: the record of {length:.0f} s shows too little")
        return lines, None
    lines.append(f"Equal within the bounds for {length:.0f} s")
    return lines, True


def _row(prefix: str, it: Comparison) -> str:
    value = f"{it.value:.2g} {it.bounds.unit}" if it.bounds.unit else ""
    is_unknown = it.recorded and not it.compared
    verdict = "unknown" if is_unknown else "equal" if it.is_equal else "DIFFERENT"
    return (
        f"{prefix + it.topic:24} {it.recorded:9} {it.replayed:9} {len(it.differences):7} {value:>11} "
        f"{it.time:7.3f} s  {verdict:9}  {it.bounds}"
    )


def _shown(record: Record, it: Difference) -> str:
    recorded, replayed = it.recorded or "nothing like it", it.replayed or "nothing like it"
    return f"at {_seconds(record, it.time)}: recorded {recorded}, replayed {replayed}"


def _seconds(record: Record, time: int) -> str:
    return f"{(time - record.begin) / SECOND:.3f} s"
