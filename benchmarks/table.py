# ruff: noqa: T201
"""Printed tables of measured figures.

Decides: what a table looks like.  Must not know: what was measured.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
Row = dict[str, float | int | str]
"""One line of a table, by column; a column may be missing."""


def show(title: str, rows: list[Row]) -> None:
    """Print rows as a table."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = [names, *([_text(row.get(name, "")) for name in names] for row in rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    print(f"\n{title}")
    for cells in table:
        line = (cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
        print("  ".join(line), flush=True)


def _text(value: float | int | str) -> str:
    """Return a number to three digits, without an exponent."""
    if not isinstance(value, float):
        return str(value)
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"
