"""Gives each robot of a plan what a picture needs: its motion, its colour and its line style.

Decides: the colours.  They are those of Okabe and Ito, which colour-blind people can distinguish,
with the yellow darkened for white paper.  From the ninth robot on, they are repeated darker and
with other dashes.
Must not know: axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.plan.document import PlanDocument, RobotPlan
from coordinator.plan.wire import Driven, drive
from coordinator.view.figure_curvature_comb import Bends, parameters
from coordinator.view.figure_selection import Manner, View

_COLOURS: Final = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#cc79a7",
    "#e69f00",
    "#56b4e9",
    "#4d4d4d",
    "#a59a00",
)
_SHADES: Final = (1.0, 0.62, 0.82, 0.45)
_SAMPLES: Final = 16
"""Number of points drawn in each span of a path."""
_DASHES: Final = ("solid", (0, (6, 1.5)), (0, (2.5, 1.2)), (0, (7, 1.5, 1.5, 1.5)))

Dash = str | tuple[int, tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class Pictured:
    """One robot: its plan, its motion as decoded from the wire bytes, and how it is drawn."""

    plan: RobotPlan
    driven: Driven
    colour: str
    ink: str
    """A darker shade of the colour, for text."""
    dash: Dash
    manner: Manner = "plain"

    @property
    def id(self) -> str:
        """The robot's id."""
        return self.plan.id

    @cached_property
    def way(self) -> Array:
        """Points (n, 2) [m] along its path, close together where it bends."""
        curve = self.driven.curve
        return curve.evaluate(parameters(curve, _SAMPLES))

    @cached_property
    def bends(self) -> Bends:
        """The curvature along its path."""
        return Bends.of(self.driven.curve)

    @property
    def pauses(self) -> list[tuple[float, float, float, str]]:
        """Its waits as (s [m], from [s], until [s], for whom), the late start included."""
        plan = self.plan
        found = [(stop.s, stop.arrive, stop.depart, stop.yields_to) for stop in plan.stops]
        if plan.start_time > 0.0:
            found.insert(0, (0.0, 0.0, plan.start_time, plan.start_yields_to))
        return [pause for pause in found if pause[2] - pause[1] > 0.05]

    @property
    def waits(self) -> float:
        """The total time of its waits [s]."""
        return sum(until - since for _, since, until, _ in self.pauses)

    def progress(self, times: Array) -> Array:
        """Return its arc lengths (n,) [m] at plan times (n,) [s]."""
        timeline = self.driven.timeline
        return np.array([timeline.s_at(time) for time in times.tolist()])


def picture_robots(document: PlanDocument, view: View | None = None) -> dict[str, Pictured]:
    """Return the robots by id, in the plan's order, each drawn as the view asks.

    Raise InputError if the view names an unknown robot, or if a robot would refuse its bytes.
    """
    view, ids = view or View(), [plan.id for plan in document.robots]
    manners, places = view.manners(ids), view.places(ids)
    return {
        plan.id: Pictured(plan, driven, *style_of(places[plan.id]), manners[plan.id])
        for plan, driven in zip(document.robots, drive(document), strict=True)
    }


class Style(NamedTuple):
    """The look that distinguishes one robot from others; `ink` is a darker shade for text."""

    colour: str
    ink: str
    dash: Dash


def style_of(place: int) -> Style:
    """Return the style of a robot from its index in the fleet."""
    turn, which = divmod(place, len(_COLOURS))
    shade, colour = _SHADES[turn % len(_SHADES)], _COLOURS[which]
    dash = _DASHES[turn % len(_DASHES)]
    return Style(_darkened(colour, shade), _darkened(colour, 0.7 * shade), dash)


def font_size(count: int) -> float:
    """Return the size of labels [pt] for a picture of `count` robots."""
    return float(np.clip(28.0 / np.sqrt(count), 4.0, 10.0))


def _darkened(colour: str, share: float) -> str:
    """Return a colour #rrggbb with its brightness reduced to a share."""
    parts = [round(int(colour[at : at + 2], 16) * share) for at in (1, 3, 5)]
    return "#" + "".join(f"{part:02x}" for part in parts)
