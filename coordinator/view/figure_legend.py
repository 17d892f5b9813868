"""Makes the legend of the floor, a row of keys with their meaning.

Decides: the keys and their words; only what the picture shows has a key.  Must not know: the page.
"""

from __future__ import annotations

from typing import Any, Final

from matplotlib.artist import Artist
from matplotlib.legend_handler import HandlerLine2D
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from coordinator.plan.document import PlanDocument
from coordinator.view.figure_ground import DASHES, GROWN, HALO, OBSTACLE, WALL
from coordinator.view.figure_robots import Pictured

_INK: Final = "#444444"
_POLYGON: Final[dict[str, Any]] = {"lw": 0.6, "marker": "o", "ms": 2.8, "mfc": "white", "mew": 0.6}
_COMB: Final[dict[str, Any]] = {"lw": 0.7, "marker": "|", "ms": 7.0, "mew": 0.5}
_CROSSING: Final[dict[str, Any]] = {"ls": "", "marker": "o", "ms": 4.5, "mfc": "white", "mew": 0.7}
_STOP: Final[dict[str, Any]] = {"ls": "", "marker": "s", "ms": 5.0, "mec": "white"}

CROWD: Final = 24
"""For more robots, stops, crossings and shortest ways are left out or have no labels."""

Keys = list[tuple[Artist, str]]


def legend_keys(
    document: PlanDocument,
    robots: dict[str, Pictured],
    grown: list[float],
    sharpest: float | None,
) -> Keys:
    """Return keys for what is drawn.

    grown: how far [m] obstacles are grown; sharpest: the curvature [1/m] of the longest tooth.
    """
    keys: Keys = []
    if document.workspace is not None:
        if document.workspace.obstacles:
            keys.append((Patch(fc=OBSTACLE, ec=WALL, lw=0.9), "obstacle"))
        keys += _grown_keys(robots, grown)
    if any(robot.manner == "detailed" for robot in robots.values()):
        keys.append((_line(_POLYGON), "control polygon"))
    keys.append((_line({"lw": 1.8}), "path"))
    if len(robots) <= CROWD and any(robot.plan.shortest is not None for robot in robots.values()):
        keys.append((_line({"lw": 1.1, "ls": (0, (1, 2.5))}), "shortest way"))
    if sharpest is not None:
        told = f"comb: longest tooth = curvature {sharpest:.3g} 1/m, radius {1.0 / sharpest:.2g} m"
        keys.append((_line(_COMB), told))
    if document.crossings:
        keys.append((_line(_CROSSING), "crossing"))
    if any(s > 0.0 for robot in robots.values() for s, *_ in robot.pauses):
        keys.append((_line(_STOP), "stop"))
    return keys


def legend_style(keys: Keys) -> dict[str, Any]:
    """Return the arguments of a legend that has these keys in one row."""
    combs = {key: HandlerLine2D(numpoints=6) for key, text in keys if text.startswith("comb")}
    polygons = {key: HandlerLine2D(numpoints=2) for key, text in keys if text.startswith("control")}
    return {
        "handles": [key for key, _ in keys],
        "labels": [text for _, text in keys],
        "handler_map": combs | polygons,
        "ncols": len(keys),
        "numpoints": 1,
        "fontsize": 8,
        "labelcolor": _INK,
        "frameon": False,
        "borderpad": 0.0,
        "borderaxespad": 0.0,
        "handlelength": 2.4,
        "handletextpad": 0.5,
        "columnspacing": 1.6,
    }


def _grown_keys(robots: dict[str, Pictured], grown: list[float]) -> Keys:
    """Return a key for each outline around the obstacles; the first one explains them."""
    count = len({round(robot.plan.radius, 6) for robot in robots.values()})
    some = f", {len(grown)} of {count}" if count > len(grown) else ""
    keys: Keys = []
    for reach, dash in zip(grown, DASHES, strict=False):
        first = not keys
        said = f" (radius + margin{some}): no centre inside" if first else ""
        key = Patch(fc=HALO if first else "none", ec=GROWN, lw=0.8, ls=dash)
        keys.append((key, f"{'grown by ' if first else 'by '}{reach:.3g} m{said}"))
    return keys


def _line(style: dict[str, Any]) -> Line2D:
    return Line2D([], [], color=_INK, **style)
