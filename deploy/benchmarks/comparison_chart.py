"""Draws the comparison: `python -m deploy.benchmarks.comparison_chart RESULTS SVG` in .venv-bench."""

from __future__ import annotations

import json
import statistics
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from deploy.benchmarks.table import SIZES, Results

PANELS = {
    "pipeline.{}.p50_ms": "Latency through three processes, p50 [ms]",
    "pipeline.{}.cpu_us": "CPU of the middle process [µs/item]",
    "flood.{}.per_second": "Received in a flood [items/s]",
}


def spread(rounds: Sequence[float]) -> tuple[float, float, float]:
    """Return the median, and how far the least and the greatest round are from it."""
    median = statistics.median(rounds)
    return median, median - min(rounds), max(rounds) - median


def draw(results: Results, file: Path) -> None:
    """Draw a panel for each figure, a group of bars for each size."""
    # Text stays text, and the same figures give the same file.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "benchmarks", "font.size": 9})
    figure = Figure(figsize=(9, 9), layout="constrained")
    for axes, (key, title) in zip(figure.subplots(len(PANELS)), PANELS.items(), strict=True):
        _panel(axes, results, key)
        axes.set_title(title, loc="left", fontsize=10)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    figure.savefig(file, format="svg", metadata={"Date": None})


def _panel(axes: Any, results: Mapping[str, Mapping[str, Sequence[float]]], key: str) -> None:
    width, colors = 0.8 / len(results), matplotlib.colormaps["tab20"]
    for number, (name, figures) in enumerate(results.items()):
        measured = {
            place: spread(rounds)
            for place, size in enumerate(SIZES)
            if (rounds := figures.get(key.format(size), ()))
        }
        places = [place + (number - (len(results) - 1) / 2) * width for place in measured]
        medians, below, above = zip(*measured.values(), strict=True) if measured else ((), (), ())
        errors = {"elinewidth": 0.7, "ecolor": "#444"}
        axes.bar(
            places, medians, width, yerr=[below, above], error_kw=errors, label=name, color=colors(number)
        )
    axes.set_yscale("log")
    axes.set_xticks(range(len(SIZES)), SIZES.values())
    axes.grid(axis="y", color="#ddd", linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2]))
