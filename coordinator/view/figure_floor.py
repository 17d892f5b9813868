"""Draws the floor: the ground, paths, starts and goals, crossings and stops.

Decides: what is drawn on the floor, and which labels are left out when it is crowded.  Must not
know: files or the rest of the page.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from coordinator.curves.nurbs import Array
from coordinator.plan.document import Crossing, PlanDocument
from coordinator.plan.wire import curve_of
from coordinator.view.figure_curvature_comb import draw_comb, sharpest_bend
from coordinator.view.figure_ground import draw_ground, edge_points, reaches
from coordinator.view.figure_labels import Labels
from coordinator.view.figure_legend import CROWD, Keys, legend_keys
from coordinator.view.figure_robots import Pictured, font_size, style_of
from coordinator.view.figure_selection import View

_POINTS: Final = 240
"""Samples per side of the floor, for the points of paths and walls that labels should not cover."""
_SMALLEST: Final = 5.5
"""Size of the smallest labels [pt]; labels that do not fit are left out."""
_FAINT: Final = 0.35
"""Opacity of robots that are drawn faintly."""


def floor_bounds(
    document: PlanDocument, robots: dict[str, Pictured], view: View
) -> tuple[float, float, float, float]:
    """Return (x0, y0, x1, y1) [m] around the floor, all paths and all discs."""
    floor = document.workspace
    corners = [np.array(floor.boundary)] if floor is not None else []
    for robot in robots.values():
        path = _path(robot)
        corners += [path - robot.plan.radius, path + robot.plan.radius]
    corners += [np.add(left.place, ((left.radius,), (-left.radius,))) for left in view.left]
    every = np.vstack(corners)
    (x0, y0), (x1, y1) = every.min(axis=0).tolist(), every.max(axis=0).tolist()
    pad = 0.02 * max(x1 - x0, y1 - y0)
    return x0 - pad, y0 - pad, x1 + pad, y1 + pad


def draw_floor(
    axes: Axes, document: PlanDocument, robots: dict[str, Pictured], view: View | None = None
) -> Keys:
    """Draw the floor with every robot's way over it; return the keys of its legend."""
    view = view or View()
    x0, y0, x1, y1 = floor_bounds(document, robots, view)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", anchor="NW")
    axes.set_axisbelow(True)
    axes.grid(color="#eceef1", lw=0.6)
    axes.tick_params(labelsize=9, length=3)
    axes.spines[["top", "right"]].set_visible(False)
    side = max(x1 - x0, y1 - y0)
    shown = [robot for robot in robots.values() if robot.manner != "faint"]
    grown = reaches((robot.plan.radius for robot in shown), document.margin)
    if document.workspace is not None:
        draw_ground(axes, document.workspace, grown)
    size = font_size(len(shown))
    for robot in robots.values():
        _draw_way(axes, robot, size)
    if len(shown) <= CROWD:
        _draw_shortest(axes, shown, size)
    sharpest = _draw_details(axes, shown, side)
    for robot in shown:
        _draw_stops(axes, robot, size)
    met = _crossings(document, shown)
    _draw_crossings(axes, met, size)
    labels = Labels(axes, _busy(document, shown, side), _marks(met, shown))
    size = max(size, _SMALLEST)
    _draw_left(axes, labels, view, list(robots), size)
    _label_ends(labels, shown, size)
    if len(shown) <= CROWD:
        _label_stops(labels, shown, size)
        _label_crossings(labels, met, shown, size)
    return legend_keys(document, robots, grown, sharpest)


def _crossings(document: PlanDocument, shown: list[Pictured]) -> list[Crossing]:
    """Return the crossings that robots shown in full take part in."""
    names = {robot.id for robot in shown}
    return [each for each in document.crossings if each.a in names or each.b in names]


def _path(robot: Pictured) -> Array:
    """Return points (n, 2) [m] along a robot's path."""
    curve = robot.driven.curve
    return curve.at_arc(np.linspace(0.0, curve.length, _POINTS))


def _busy(document: PlanDocument, robots: list[Pictured], side: float) -> Array:
    """Return points (n, 2) [m] that labels should not cover: paths and walls, evenly dense."""
    step = side / _POINTS
    busy = [_arrow(robot) for robot in robots]
    for robot in robots:
        curve = robot.driven.curve
        busy.append(curve.at_arc(np.linspace(0.0, curve.length, 2 + int(curve.length / step))))
    if document.workspace is not None:
        busy.append(edge_points(document.workspace, step))
    return np.vstack(busy)


def _marks(met: list[Crossing], robots: list[Pictured]) -> Array:
    """Return points (n, 2) [m] that no label may cover: crossings and stops."""
    marks = [(crossing.x, crossing.y) for crossing in met]
    for robot in robots:
        stops = [s for s, *_ in robot.pauses if s > 0.0]
        marks += [(x, y) for x, y in robot.driven.curve.at_arc(stops).tolist()] if stops else []
    return np.array(marks, dtype=np.float64).reshape(-1, 2)


def _arrow(robot: Pictured) -> Array:
    """Return points (n, 2) [m] along the arrow that shows the heading at the start."""
    start = robot.driven.curve.at_arc([0.0, 1e-3 * robot.driven.curve.length])
    share = np.linspace(0.0, 1.0, 8)[:, None]
    return np.asarray(start[0] + 1.9 * robot.plan.radius * share * _direction(start))


def _draw_details(axes: Axes, robots: list[Pictured], side: float) -> float | None:
    """Draw control polygons and curvature combs; return the curvature [1/m] of the longest tooth.

    Return None if there is no comb.  side: the longer side of the floor [m].
    """
    detailed = [robot for robot in robots if robot.manner == "detailed"]
    for robot in detailed:
        control = robot.driven.curve.points.T
        style: dict[str, Any] = {"marker": "o", "ms": 2.4, "mfc": "white", "mew": 0.5}
        axes.plot(*control, color=robot.ink, lw=0.5, zorder=5.5, gid="control", **style)
    sharpest = sharpest_bend([robot.bends for robot in detailed], side)
    if sharpest is not None:
        for robot in detailed:
            draw_comb(axes, robot.bends, robot.colour, side, sharpest)
    return sharpest


def _draw_way(axes: Axes, robot: Pictured, size: float) -> None:
    """Draw one robot's path, start disc with heading, and goal ring."""
    path, radius, colour = robot.way, robot.plan.radius, robot.colour
    if robot.manner == "faint":
        axes.plot(*path.T, color=colour, lw=0.8, alpha=_FAINT, zorder=3)
        for end, style in ((path[0], "solid"), (path[-1], (0, (3, 2)))):
            ring = {"fill": False, "ec": colour, "lw": 0.7, "ls": style, "alpha": _FAINT}
            axes.add_patch(Circle(end, radius, zorder=3, **ring))
        return
    axes.plot(
        *path.T, color=colour, lw=0.19 * size, ls=robot.dash, zorder=5, solid_capstyle="round"
    )
    axes.add_patch(Circle(path[0], radius, fc=colour, ec="none", alpha=0.3, zorder=4))
    axes.add_patch(Circle(path[0], radius, fill=False, ec=colour, lw=1.0, zorder=6))
    axes.add_patch(
        Circle(path[-1], radius, fill=False, ec=colour, lw=1.0, ls=(0, (3, 2)), zorder=6)
    )
    axes.plot(*path[-1], "X", color=colour, ms=0.6 * size, mew=0, zorder=7)
    arrow = _arrow(robot)
    axes.annotate(
        "",
        arrow[-1],
        arrow[0],
        arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.3, "shrinkA": 0, "shrinkB": 0},
        zorder=7,
    )


def _draw_shortest(axes: Axes, robots: list[Pictured], size: float) -> None:
    """Dot the shortest ways of robots that leave them."""
    for robot in robots:
        if robot.plan.shortest is not None:
            curve = curve_of(robot.plan.shortest)
            points = curve.at_arc(np.linspace(0.0, curve.length, _POINTS))
            style: dict[str, Any] = {"lw": 0.11 * size, "ls": (0, (1, 2.5)), "zorder": 4}
            axes.plot(*points.T, color=robot.colour, gid="shortest", **style)


def _draw_crossings(axes: Axes, met: list[Crossing], size: float) -> None:
    crossings = np.array([(crossing.x, crossing.y) for crossing in met])
    if len(crossings):
        axes.plot(
            *crossings.T,
            "o",
            mfc="white",
            mec="#333333",
            mew=0.07 * size,
            ms=0.5 * size,
            ls="",
            zorder=6,
        )


def _draw_stops(axes: Axes, robot: Pictured, size: float) -> None:
    """Draw a square on the path wherever the robot stops for a while."""
    for s, *_ in robot.pauses:
        if s > 0.0:
            spot = robot.driven.curve.at_arc(s)[0]
            edge, wide = 0.08 * size, 0.8 * size
            axes.plot(*spot, "s", mfc=robot.colour, mec="white", mew=edge, ms=wide, zorder=8)


def _draw_left(axes: Axes, labels: Labels, view: View, ids: list[str], size: float) -> None:
    """Draw the robots that have stayed behind as hollow discs in their colours, and name them."""
    places = view.places(ids)
    for left in view.left:
        style = style_of(places[left.id])
        ring = {"fill": False, "ec": style.colour, "lw": 1.4, "zorder": 6, "gid": "left"}
        axes.add_patch(Circle(left.place, left.radius, **ring))
        labels.keep_free(left.place, left.radius)
        labels.place(
            f"{left.id}, {left.why}",
            left.place,
            size=size,
            colour=style.ink,
            away=left.radius,
            weight="bold",
        )


def _label_ends(labels: Labels, robots: list[Pictured], size: float) -> None:
    """Write every robot's name behind its start, then every robot's name beyond its goal."""
    ends = [(robot, _path(robot)) for robot in robots]
    for robot, path in ends:
        labels.keep_free((path[0, 0], path[0, 1]), robot.plan.radius)
        labels.keep_free((path[-1, 0], path[-1, 1]), robot.plan.radius)
    behind = [(robot, path[0], -_direction(path[:2]), robot.id) for robot, path in ends]
    beyond = [(robot, path[-1], _direction(path[-2:]), f"{robot.id} goal") for robot, path in ends]
    for robot, point, way, mark in behind + beyond:
        labels.place(
            mark,
            (float(point[0]), float(point[1])),
            size=size,
            colour=robot.ink,
            away=robot.plan.radius,
            heading=math.atan2(way[1], way[0]),
            weight="bold" if mark == robot.id else "normal",
            optional=mark != robot.id and len(robots) > CROWD,
        )


def _label_stops(labels: Labels, robots: list[Pictured], size: float) -> None:
    """Label each stop with its duration if there is room."""
    for robot in robots:
        for s, since, until, _ in robot.pauses:
            x, y = robot.driven.curve.at_arc(s)[0].tolist()
            if s > 0.0:
                labels.place(
                    f"{robot.id} {until - since:.1f} s",
                    (x, y),
                    size=max(0.9 * size, _SMALLEST),
                    colour=robot.ink,
                    optional=True,
                )


def _label_crossings(
    labels: Labels, met: list[Crossing], robots: list[Pictured], size: float
) -> None:
    """Label crossings with the robot that waits there, once for each wait, if there is room."""
    ink = {robot.id: robot.ink for robot in robots}
    said = set()
    for crossing in met:
        who = crossing.verdict.split(" ")[0]
        if who in ink and crossing.verdict not in said:
            stands = labels.place(
                crossing.verdict,
                (crossing.x, crossing.y),
                size=max(0.85 * size, _SMALLEST),
                colour=ink[who],
                optional=True,
            )
            if stands:
                said.add(crossing.verdict)


def _direction(ends: Array) -> Array:
    """Return the unit vector (2,) from the first to the last of points (n, 2)."""
    way = ends[-1] - ends[0]
    return np.asarray(way / max(float(np.hypot(*way)), 1e-12))
