"""Draws the distance-time diagram: a lane per robot with its arc length over time.

Behind the curve, each wait has a shaded region: the arc lengths and times at which the waiting
robot would be too near the robot that it waits for (figure_forbidden.py).

Decides: the lanes and what is drawn into them.  Must not know: the floor.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes

from coordinator.curves.nurbs import Array
from coordinator.findings.giving_way import SLOWS, GivingWay, giving_way
from coordinator.plan.document import PlanDocument
from coordinator.view.figure_forbidden import Forbidden, forbidden
from coordinator.view.figure_robots import Pictured, font_size

_FULL: Final = 0.78
"""Height of a lane's curve at the goal, in lanes."""
_FEW: Final = 12
"""Crossings are shown in the lanes for at most this many robots."""
_LOWEST: Final = 12.0
"""Lanes lower than this [pt] show no forbidden regions, which would be too small to see."""
_LIGHT: Final = 0.33
"""Opacity of forbidden regions."""


def draw_times(axes: Axes, document: PlanDocument, robots: dict[str, Pictured]) -> None:
    """Draw every robot's way over time, with its waits and for whom it waits."""
    count = len(robots)
    end = max(robot.plan.finish_time for robot in robots.values())
    axes.set(xlim=(0.0, end), ylim=(-float(count), 0.0), yticks=[])
    axes.grid(axis="x", color="#e3e6ea", lw=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=9, length=3)
    axes.spines[["top", "right", "left"]].set_visible(False)
    figure = axes.get_figure(root=True)
    assert figure is not None
    width, height = 72.0 * axes.bbox.width / figure.dpi, 72.0 * axes.bbox.height / figure.dpi
    size = min(1.15 * font_size(count), 10.0, 0.85 * height / count)
    roomy = height / count >= _LOWEST
    axes.set_xlabel(_legend(document, count, roomy), size=8.5, linespacing=1.4)
    regions = _regions(document, robots if roomy else {})
    yields = giving_way(document, [robot.driven for robot in robots.values()]) if roomy else []
    for index, robot in enumerate(robots.values()):
        found = regions.get(robot.id, [])
        lane = _Lane(axes, robot, found, -index - 1.0, end, width / end, height / count, size)
        lane.draw_way()
        lane.draw_regions()
        for pause in robot.pauses:
            owner = robots.get(pause[3])
            lane.draw_pause(pause, robot.ink if owner is None else owner.ink)
        lane.draw_yields([one for one in yields if one.robot == robot.id], robots)
    if count <= _FEW:
        _draw_crossings(axes, document, robots)


@dataclass(frozen=True, eq=False)
class _Lane:
    """One robot's lane: the height of its base, and the scales of its axes."""

    axes: Axes
    robot: Pictured
    regions: list[tuple[Forbidden, str]]
    """The regions that force the robot's waits, and the colour of each."""
    base: float
    end: float
    second: float
    """Width of a second [pt]."""
    tall: float
    """Height of a lane [pt]."""
    size: float

    def draw_way(self) -> None:
        """Draw the robot's name, its way over time, and when it arrives."""
        plan, colour, end = self.robot.plan, self.robot.colour, self.end
        marks = [plan.start_time, plan.finish_time]
        times = np.unique(np.append(np.linspace(0.0, end, 300), marks))
        height = self._height(self.robot.progress(times))
        moving = times <= plan.finish_time
        self.axes.axhline(self.base, color="#c9cdd3", lw=0.5, zorder=1)
        self.axes.fill_between(times, self.base, height, color=colour, alpha=0.13, lw=0, zorder=2)
        thick = min(1.7, 0.2 * self.size)
        self.axes.plot(times[moving], height[moving], color=colour, lw=thick, zorder=4)
        self.axes.plot(times[~moving], height[~moving], color=colour, lw=0.7, alpha=0.5, zorder=4)
        style: dict[str, Any] = {"color": self.robot.ink, "size": self.size, "va": "center"}
        middle = self.base + 0.5 * _FULL
        self.axes.text(-0.01 * end, middle, self.robot.id, ha="right", weight="bold", **style)
        arrival = f"{plan.length:.1f} m, {plan.finish_time:.1f} s"
        self.axes.text(1.01 * end, middle, arrival, ha="left", **style)

    def draw_regions(self) -> None:
        """Shade the regions that force the robot's waits."""
        style: dict[str, Any] = {"lw": 0, "alpha": _LIGHT, "zorder": 3, "gid": "forbidden"}
        for region, colour in self.regions:
            begin, end = (np.clip(t, 0.0, self.end) for t in (region.begin, region.end))
            self.axes.fill_betweenx(self._height(region.s), begin, end, fc=colour, **style)

    def draw_pause(self, pause: tuple[float, float, float, str], ink: str) -> None:
        """Draw one wait as a thick plateau, and write beside it which robot is let pass.

        The curve never descends, so there is room above it to the left of the departure.  A text
        too long for that room goes above the curve's highest point below the text.  In both cases
        the text is above the shaded regions.  Where the lane above is too near, the text goes below
        the plateau, where there is room to the right of the arrival.
        """
        s, since, until, owner = pause
        height = float(self._height(np.array(s)))
        thick = min(4.5, 0.2 * self.tall)
        line = [height, height]
        self.axes.plot([since, until], line, color=self.robot.colour, lw=thick, zorder=5)
        text = f"{until - since:.1f} s for {owner}" if owner else f"{until - since:.1f} s"
        size = 0.9 * self.size
        width = 0.58 * size * len(text) / self.second
        roomy = self.tall > 2.6 * size
        if not roomy and (until - since < width or self.tall < 1.7 * size):
            return
        style: dict[str, Any] = {"textcoords": "offset points", "size": size, "color": ink}
        away = 0.5 * thick + 1.0
        right = max(until, width)
        top = float(self._height(self.robot.progress(np.array([right])))[0])
        if (top - self.base) * self.tall + away + size > self.tall and since + width < self.end:
            offset = (1.0, -away)
            self.axes.annotate(
                text, (since, height), offset, ha="left", va="top", zorder=7, **style
            )
            return
        shift = -3.0 if right == until else 3.0
        height = height if right == until else top
        height = self._above_regions(right - width, right, height, (away + size) / self.tall)
        self.axes.annotate(
            text, (right, height), (shift, away), ha="right", va="bottom", zorder=7, **style
        )

    def draw_yields(self, yields: list[GivingWay], robots: dict[str, Pictured]) -> None:
        """Widen the curve where the robot slows down; write for whom, and whom it passes how."""
        style: dict[str, Any] = {"size": self.size, "textcoords": "offset points", "zorder": 7}
        free = 0.0
        for one in yields:
            slows = one.how == SLOWS
            times = np.linspace(one.since, one.until, 50)
            heights = self._height(self.robot.progress(times))
            if slows:
                wide = min(6.0, 0.25 * self.tall)
                self.axes.plot(
                    times, heights, color=self.robot.colour, lw=wide, alpha=0.35, gid="slows"
                )
            text = f"slows {one.lost:.1f} s for" if slows else one.how
            text = f"{text} {one.other}"
            width = (0.55 * self.size * len(text) + 8.0) / self.second
            left = max(float(times[-1]) - width, free)
            free = left + width
            top = float(self._height(self.robot.progress(np.array([free])))[0])
            low = min(top, self.base + 1.0 - self.size / self.tall)
            ink = robots[one.other].ink
            self.axes.annotate(text, (left, low), (2.0, 1.0), color=ink, va="bottom", **style)

    def _above_regions(self, left: float, right: float, height: float, room: float) -> float:
        """Return a height for a text of height `room` above the shaded regions, if it fits."""
        raised = height
        for region, _ in self.regions:
            levels = self._height(region.s[(region.begin < right) & (region.end > left)])
            if len(levels) and levels.min() < raised + room and levels.max() > raised:
                raised = float(levels.max())
        return raised if raised + room <= self.base + 1.0 else height

    def _height(self, s: Array) -> Array:
        """Return the heights in the diagram of arc lengths [m]."""
        return _height(self.base, self.robot, s)


def _legend(document: PlanDocument, count: int, roomy: bool) -> str:
    """Return the text below the diagram: the time axis, and what the lanes contain."""
    told = ["a lane: from start to goal"]
    if roomy and any(robot.shortest is not None for robot in document.robots):
        told.append("wide: slower than it could")
    if roomy and document.waits:
        told.append("shaded: forbidden by the robot that it waits for")
    if count <= _FEW and document.crossings:
        told.append("dots: crossings")
    return f"plan time [s]\n{';  '.join(told)}"


def _regions(
    document: PlanDocument, robots: dict[str, Pictured]
) -> dict[str, list[tuple[Forbidden, str]]]:
    """Return the regions that force each robot's waits, with the colour of the robot let pass."""
    found: dict[str, list[tuple[Forbidden, str]]] = {name: [] for name in robots}
    for reason in document.waits:
        robot, other = robots.get(reason.robot), robots.get(reason.yields_to)
        if robot is not None and other is not None and robot is not other:
            region = forbidden(robot.driven, other.driven, reason, document)
            found[robot.id].append((region, other.colour))
    return found


def _height(base: float, robot: Pictured, s: Array) -> Array:
    """Return the heights of arc lengths [m] in a lane whose base is at height `base`."""
    return np.asarray(base + _FULL * s / robot.driven.timeline.length)


def _draw_crossings(axes: Axes, document: PlanDocument, robots: dict[str, Pictured]) -> None:
    """Put a dot in both lanes where a crossing is passed, in the colour of the other robot."""
    names = list(robots)
    for crossing in document.crossings:
        for me, other, time, s in (
            (crossing.a, crossing.b, crossing.t_a, crossing.s_a),
            (crossing.b, crossing.a, crossing.t_b, crossing.s_b),
        ):
            if me in robots and other in robots:
                height = _height(-names.index(me) - 1.0, robots[me], np.array(s))
                colour = robots[other].colour
                axes.plot(time, height, "o", mfc=colour, mec="white", mew=0.8, ms=6.0, zorder=6)
