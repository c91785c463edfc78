"""Rows of words in columns."""

from __future__ import annotations

from collections.abc import Sequence

from interfaces.plain_text import plain


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows of cells in columns as wide as needed, one row per line; what others wrote is made plain."""
    rows = [[plain(cell) for cell in row] for row in rows]
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )
