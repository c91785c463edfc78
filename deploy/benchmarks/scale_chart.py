"""Draws the cost of many: `python -m deploy.benchmarks.scale_chart RESULTS SVG` in .venv-bench."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from deploy.benchmarks.table import Results

PANELS = {
    "cpu": ("CPU of an arm [% of a core]", "arms"),
    "packets": ("Packets of an arm [1/s]", "arms"),
    "publisher_us": ("CPU of the publisher [µs/item]", "subscribers"),
}


def draw(results: Mapping[str, Results], file: Path) -> None:
    """Draw a panel for each figure, a line for each kind of number that has it."""
    # Text stays text, and the same figures give the same file.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "benchmarks", "font.size": 9})
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    for axes, (name, (title, number)) in zip(figure.subplots(1, len(PANELS)), PANELS.items(), strict=True):
        for color, (kind, rows) in enumerate(results.items()):
            points = [(int(count), figures[name][0]) for count, figures in rows.items() if name in figures]
            if points:
                line = axes.plot(*zip(*points, strict=True), marker="o", label=kind, color=f"C{color}")
                line[0].set_clip_on(False)  # a marker may be on the edge
        axes.set_title(title, loc="left", fontsize=10)
        axes.set_xlabel(number)
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.grid(color="#ddd", linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
    lines = {line.get_label(): line for axes in figure.axes for line in axes.get_lines()}
    figure.legend(lines.values(), lines, loc="outside lower center", ncols=len(lines), frameon=False)
    figure.savefig(file, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2]))
