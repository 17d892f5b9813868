"""The figure of docs/benchmarks.md: how preparation and query times grow with a floor's corners.

Decides: the picture.  Must not know: how times were measured.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from matplotlib.figure import Figure

Curve = list[tuple[int, float, float]]
"""Points (number of corners, preparation time [s], query time [s])."""

_COLOURS: Final = ("#0072b2", "#d55e00", "#6a9a2d")
_MARKERS: Final = "osD"


def draw(curves: dict[str, Curve], path: Path) -> None:
    """Write the figure; each library has a colour, a marker and its name at its line."""
    figure = Figure(figsize=(9.0, 4.2), layout="constrained")
    both = figure.subplots(1, 2)
    for axes, column, title in zip(both, (1, 2), ("prepare a floor", "one query"), strict=True):
        for (name, curve), colour, marker in zip(curves.items(), _COLOURS, _MARKERS, strict=True):
            corners = [row[0] for row in curve]
            times = [1e3 * row[column] for row in curve]
            axes.loglog(corners, times, color=colour, marker=marker, linewidth=2.0, label=name)
        ticks = sorted({row[0] for curve in curves.values() for row in curve})
        axes.set_xticks(ticks, [f"{tick:,}" for tick in ticks])
        axes.minorticks_off()
        axes.set_title(title)
        axes.set_xlabel("corners")
        axes.set_ylabel("median time [ms]")
        axes.grid(alpha=0.3)
    both[0].legend(frameon=False)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=120, metadata={"Software": None})
