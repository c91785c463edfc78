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
    "cpu": "CPU of one arm among so many [% of a core]",
    "packets": "Packets of one arm among so many [1/s]",
    "publisher_us": "CPU of a publisher with so many subscribers [µs/item]",
}


def draw(results: Mapping[str, Results], file: Path) -> None:
    """Draw a panel for each figure, a line for each kind of number that has it."""
    # Text stays text, and the same figures give the same file.
    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "benchmarks", "font.size": 9})
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    for axes, (name, title) in zip(figure.subplots(1, len(PANELS)), PANELS.items(), strict=True):
        for color, (kind, rows) in enumerate(results.items()):
            points = [(int(number), figures[name][0]) for number, figures in rows.items() if name in figures]
            if points:
                axes.plot(*zip(*points, strict=True), marker="o", label=kind, color=f"C{color}")
        axes.set_title(title, loc="left", fontsize=8)
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.grid(color="#ddd", linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(frameon=False, fontsize=7)
    figure.savefig(file, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    draw(json.loads(Path(sys.argv[1]).read_text()), Path(sys.argv[2]))
