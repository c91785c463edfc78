"""The figures of all rounds as Markdown: medians, and the least and the greatest of the rounds."""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence

Results = Mapping[str, Mapping[str, Sequence[float]]]
"""The rounds of each figure, by alternative and by name of the figure."""

RATES = {100: "100 Hz", 500: "500 Hz", 1000: "1 kHz", 4000: "4 kHz"}
SIZES = {8: "8 B", 1_000: "1 kB", 1_000_000: "1 MB", 10_000_000: "10 MB"}


def shown(value: float) -> str:
    """Return a number with two or three digits that count."""
    if value >= 100:
        return f"{value:,.0f}"
    return f"{value:.1f}" if value >= 10 else f"{value:.2f}"


def cell(rounds: Sequence[float]) -> str:
    """Return the median and, in brackets, the least and the greatest round."""
    if not rounds:
        return "–"
    median = shown(statistics.median(rounds))
    return median if len(rounds) == 1 else f"{median} ({shown(min(rounds))}–{shown(max(rounds))})"


def table(title: str, results: Results, figures: Mapping[str, str]) -> str:
    """Return a table with a row for each alternative; `figures` are headings by name of the figure."""
    lines = [f"| {title} | {' | '.join(figures.values())} |", f"|---|{'---:|' * len(figures)}"]
    for name, rounds in results.items():
        cells = (cell(rounds.get(figure, ())) for figure in figures)
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def chain_tables(results: Results) -> str:
    """Return all tables of the arm's own chain and watchdog."""
    titles = {
        "p50_ms": "θ1 to speed: latency, p50 [ms]",
        "p99_ms": "θ1 to speed: latency, p99 [ms]",
        "cpu_us": "θ1 to speed: CPU of both processes [µs/item]",
        "delivered": "θ1 to speed: delivered [%]",
        "megabytes": "θ1 to speed: proportional set size of both processes [MB]",
    }
    chain = [
        table(title, results, {f"chain.{rate}.{figure}": heading for rate, heading in RATES.items()})
        for figure, title in titles.items()
    ]
    heartbeats = {"watchdog.20.cpu_percent": "20 Hz", "watchdog.10000.cpu_percent": "10 kHz"}
    return "\n\n".join([*chain, table("operator watchdog: CPU [% of a core]", results, heartbeats)])


def tables(results: Results) -> str:
    """Return all tables of the comparison with alternatives."""
    titles = {
        "pipeline.{}.p50_ms": "pipeline: latency, p50 [ms]",
        "pipeline.{}.p99_ms": "pipeline: latency, p99 [ms]",
        "pipeline.{}.cpu_us": "pipeline: CPU of the middle process [µs/item]",
        "pipeline.{}.megabytes": "pipeline: proportional set size of the middle process [MB]",
        "pipeline.{}.delivered": "pipeline: delivered [%]",
        "flood.{}.per_second": "flood: received [items/s]",
        "flood.{}.cpu_us": "flood: CPU of the subscriber [µs/item]",
    }
    by_size = [
        table(title, results, {figure.format(size): heading for size, heading in SIZES.items()})
        for figure, title in titles.items()
    ]
    rest = {"start.8.seconds": "start to first item [s]", "pipeline.8.threads": "threads of the middle"}
    return "\n\n".join([*by_size, table("the rest", results, rest)])
