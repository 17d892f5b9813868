"""Draws a plan as one picture: the floor, the distance-time diagram, and why robots wait.

Decides: the layout of the page, its headline, and the file formats.  Must not know: how a plan is
found, or how each part of the page is drawn.  matplotlib is imported when a picture is drawn.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from coordinator.base.errors import InputError
from coordinator.plan.document import PlanDocument, Proof
from coordinator.proof.wording import slack_of, survived
from coordinator.view.figure_selection import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH: Final = 16.0
"""Width of the page [in]; fonts are chosen to be legible at 1600 pixels."""
_LEFT: Final = 0.6
_GAP: Final = 0.95
_HEAD: Final = 1.15
_KEYS: Final = 0.93
"""Distance from the top of the page to the middle of the floor's legend [in]."""
_PANEL: Final = 2.7
_PANEL_GAP: Final = 1.0
_TITLES: Final = 0.45
"""Part of the gap between panels that the lower panel's titles take [in]."""
_EXPLAINED: Final = 0.5
_FOOT: Final = 0.75
_METADATA: Final[dict[str, dict[str, str | None]]] = {
    ".svg": {"Date": None, "Creator": "splinefleet"},
    ".png": {"Software": "splinefleet"},
}
_SETTINGS: Final[dict[Any, Any]] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "splinefleet",
    "font.family": ["DejaVu Sans"],
    "text.parse_math": False,
    "axes.edgecolor": "#8a8f98",
    "axes.linewidth": 0.7,
    "axes.labelcolor": "#444444",
    "xtick.color": "#8a8f98",
    "ytick.color": "#8a8f98",
    "xtick.labelcolor": "#444444",
    "ytick.labelcolor": "#444444",
}


def draw_plan(document: PlanDocument, out: Path, view: View | None = None) -> None:
    """Write a picture of the plan to a .svg or .png file.

    The same plan and view give the same bytes of SVG.  Raise InputError, one sentence for each
    problem, for another suffix, a plan without robots or with a path that no robot would accept, a
    view that names unknown robots, and a file that cannot be written.
    """
    suffix = out.suffix.lower()
    if suffix not in _METADATA:
        raise InputError(
            [f"{out}: a picture must end in .svg or .png, a page in .html, not in {suffix!r}"]
        )
    if not document.robots:
        raise InputError([f"plan: {document.scenario!r} has no robots to draw"])
    import matplotlib

    with matplotlib.rc_context(_SETTINGS):
        figure = _compose(document, view)
        try:
            figure.savefig(out, dpi=150, metadata=_METADATA[suffix])
        except OSError as error:
            raise InputError([f"{out}: {error.strerror}"]) from None


def _compose(document: PlanDocument, view: View | None) -> Figure:
    """Lay the page out from the top: headline, floor beside diagram, rows of waiting robots."""
    from matplotlib.figure import Figure

    from coordinator.view.figure_distance_time import draw_times
    from coordinator.view.figure_floor import draw_floor, floor_bounds
    from coordinator.view.figure_legend import legend_style
    from coordinator.view.figure_robots import picture_robots
    from coordinator.view.figure_waits import draw_wait, explanation, longest_waits

    view = view or View()
    robots = picture_robots(document, view)
    x0, y0, x1, y1 = floor_bounds(document, robots, view)
    tall = min(max(8.4 * (y1 - y0) / (x1 - x0), 4.6), 7.4)
    tall = max(tall, 0.085 * len(robots))
    wide = min(max(tall * (x1 - x0) / (y1 - y0), 4.0), 8.4)
    waiting = longest_waits(
        {name: robot for name, robot in robots.items() if robot.manner != "faint"}
    )
    columns = len(waiting) if len(waiting) <= 4 else 3
    rows = -(-len(waiting) // columns) if waiting else 0
    height = _HEAD + tall + _FOOT + rows * (_PANEL + _PANEL_GAP) + _EXPLAINED * bool(rows)
    figure = Figure(figsize=(_WIDTH, height))

    def axes(left: float, top: float, width: float, size: float) -> Axes:
        box = (left / _WIDTH, 1.0 - (top + size) / height, width / _WIDTH, size / height)
        return figure.add_axes(box)

    _headline(figure, document, height)
    keys = draw_floor(axes(_LEFT, _HEAD, wide, tall), document, robots, view)
    place = (_LEFT / _WIDTH, 1.0 - _KEYS / height)
    figure.legend(loc="center left", bbox_to_anchor=place, **legend_style(keys))
    left = _LEFT + wide + _GAP
    draw_times(axes(left, _HEAD, _WIDTH - left - 1.3, tall), document, robots)
    if waiting:
        line = 1.0 - (_HEAD + tall + _FOOT) / height
        style: dict[str, Any] = {"size": 9, "color": "#444444", "va": "top", "linespacing": 1.5}
        figure.text(_LEFT / _WIDTH, line, explanation(waiting, document), **style)
    room = _WIDTH - 2.0 * _LEFT
    for index, robot in enumerate(waiting):
        row, column = divmod(index, columns)
        top = _HEAD + tall + _FOOT + _EXPLAINED + _TITLES + row * (_PANEL + _PANEL_GAP)
        width = (room + 0.65) / columns - 0.65
        panel = axes(_LEFT + column * (width + 0.65), top, width, _PANEL)
        draw_wait(panel, robot, robots, document)
    return figure


def _headline(figure: Figure, document: PlanDocument, height: float) -> None:
    """Write the scenario's name, the terms of the plan, and whether it is proven."""
    name = "".join(mark if mark.isprintable() else " " for mark in document.scenario)[:80]
    if document.epoch > 1:
        name += f", epoch {document.epoch}"
    terms = f"policy {document.policy}  ·  tau {document.tau:g} s  ·  margin {document.margin:g} m"
    verdict, rest, colour = _proven(document.proof)
    left, top = _LEFT / _WIDTH, 1.0 - 0.32 / height
    figure.text(left, top, name, size=17, weight="bold", color="#222222", va="center")
    line = 1.0 - 0.64 / height
    figure.text(left, line, f"{verdict}{rest}", size=10.5, color=colour, va="center")
    right = 1.0 - _LEFT / _WIDTH
    figure.text(right, top, terms, size=10.5, color="#444444", va="center", ha="right")


def _proven(proof: Proof | None) -> tuple[str, str, str]:
    """Return the proof's verdict, the distances that it found, and the colour of the text."""
    if proof is None:
        return "not proven", "", "#a33a00"
    found = [""]
    if proof.least_separation is not None:
        found.append(f"least separation {proof.least_separation:.3f} m")
    if proof.least_slack is not None:
        found.append(f"tightest pair {slack_of(proof.least_slack)}")
    if proof.least_clearance is not None:
        found.append(f"least clearance {proof.least_clearance:.3f} m")
    if proof.survives:
        found.append(survived(proof.survives))
    verdict = "proof holds" if proof.holds else "PROOF FAILS: do not drive this plan"
    return verdict, "  ·  ".join(found), "#00664a" if proof.holds else "#a33a00"
