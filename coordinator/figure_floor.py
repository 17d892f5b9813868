"""The floor: obstacles, paths, starts and goals, crossings and stops.

Decides: what is drawn on the floor, and which labels give way when it gets crowded.  Must not
know: files or the rest of the page.
"""

from __future__ import annotations

import math

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from coordinator.figure_labels import Labels
from coordinator.figure_robots import Pictured, font_size
from coordinator.nurbs import Array
from coordinator.plan import PlanDocument

_WALL = "#6b7280"
_OBSTACLE = "#d3d7de"
_POINTS = 240
_SMALLEST = 5.5
"""Size of the smallest labels [pt]; those without room are left out."""


def floor_bounds(
    document: PlanDocument, robots: dict[str, Pictured]
) -> tuple[float, float, float, float]:
    """Return (x0, y0, x1, y1) [m] around the floor, all paths and all discs."""
    corners = [np.array(polygon) for polygon in _outline(document)]
    for robot in robots.values():
        path = _path(robot)
        corners += [path - robot.plan.radius, path + robot.plan.radius]
    every = np.vstack(corners)
    (x0, y0), (x1, y1) = every.min(axis=0).tolist(), every.max(axis=0).tolist()
    pad = 0.02 * max(x1 - x0, y1 - y0)
    return x0 - pad, y0 - pad, x1 + pad, y1 + pad


def draw_floor(axes: Axes, document: PlanDocument, robots: dict[str, Pictured]) -> None:
    """Draw the floor with every robot's way over it."""
    x0, y0, x1, y1 = floor_bounds(document, robots)
    axes.set(xlim=(x0, x1), ylim=(y0, y1), xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", anchor="NW")
    axes.set_axisbelow(True)
    axes.grid(color="#eceef1", lw=0.6)
    axes.tick_params(labelsize=9, length=3)
    axes.spines[["top", "right"]].set_visible(False)
    _draw_workspace(axes, document)
    size = font_size(len(robots))
    for robot in robots.values():
        _draw_way(axes, robot, size)
        _draw_stops(axes, robot, size)
    _draw_crossings(axes, document, size)
    labels = Labels(axes, _busy(document, robots))
    size = max(size, _SMALLEST)
    _label_ends(labels, robots, size)
    _label_stops(labels, robots, size)
    _label_crossings(labels, document, robots, size)


def _outline(document: PlanDocument) -> list[list[tuple[float, float]]]:
    """Return the boundary, when the document has one, as a list of one polygon."""
    floor = document.workspace
    return [floor.boundary] if floor is not None and floor.boundary else []


def _path(robot: Pictured) -> Array:
    """Return points (n, 2) [m] along a robot's path."""
    curve = robot.driven.curve
    return curve.at_arc(np.linspace(0.0, curve.length, _POINTS))


def _busy(document: PlanDocument, robots: dict[str, Pictured]) -> Array:
    """Return points (n, 2) [m] that labels should not cover: paths, crossings, walls."""
    busy = [_path(robot) for robot in robots.values()]
    busy += [_arrow(robot) for robot in robots.values()]
    busy += [np.array([(crossing.x, crossing.y)] * 6) for crossing in document.crossings]
    share = np.linspace(0.0, 1.0, 40)[:, None]
    obstacles = [] if document.workspace is None else document.workspace.obstacles
    for outline in (*_outline(document), *filter(None, obstacles)):
        corners = np.array(outline)
        for corner, following in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            busy.append(corner + share * (following - corner))
    return np.vstack(busy)


def _arrow(robot: Pictured) -> Array:
    """Return points (n, 2) [m] along the arrow that shows the heading at the start."""
    start = robot.driven.curve.at_arc([0.0, 1e-3 * robot.driven.curve.length])
    share = np.linspace(0.0, 1.0, 8)[:, None]
    return np.asarray(start[0] + 1.9 * robot.plan.radius * share * _direction(start))


def _draw_workspace(axes: Axes, document: PlanDocument) -> None:
    for polygon in _outline(document):
        axes.add_patch(Polygon(polygon, fill=False, ec=_WALL, lw=1.4, zorder=2))
    if document.workspace is not None:
        for polygon in filter(None, document.workspace.obstacles):
            axes.add_patch(Polygon(polygon, fc=_OBSTACLE, ec=_WALL, lw=0.9, zorder=1))


def _draw_way(axes: Axes, robot: Pictured, size: float) -> None:
    """Draw one robot's control polygon, path, start disc with heading, and goal ring."""
    path, radius, colour = _path(robot), robot.plan.radius, robot.colour
    control = np.array(robot.plan.path.control_points)
    faint = 0.045 * size
    axes.plot(*control.T, color=colour, lw=0.5, alpha=faint, zorder=3)
    axes.plot(*control.T, "o", color=colour, ms=1.8, mew=0, alpha=faint, zorder=3)
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


def _draw_crossings(axes: Axes, document: PlanDocument, size: float) -> None:
    crossings = np.array([(crossing.x, crossing.y) for crossing in document.crossings])
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


def _label_ends(labels: Labels, robots: dict[str, Pictured], size: float) -> None:
    """Name every robot behind its start and beyond its goal."""
    ends = [(robot, _path(robot)) for robot in robots.values()]
    for robot, path in ends:
        labels.keep_free((path[0, 0], path[0, 1]), robot.plan.radius)
        labels.keep_free((path[-1, 0], path[-1, 1]), robot.plan.radius)
    for robot, path in ends:
        for point, way, mark in (
            (path[0], -_direction(path[:2]), robot.id),
            (path[-1], _direction(path[-2:]), f"{robot.id} goal"),
        ):
            labels.place(
                mark,
                (float(point[0]), float(point[1])),
                size=size,
                colour=robot.ink,
                away=robot.plan.radius,
                heading=math.atan2(way[1], way[0]),
                weight="bold" if mark == robot.id else "normal",
            )


def _label_stops(labels: Labels, robots: dict[str, Pictured], size: float) -> None:
    """Say at a stop how long it lasts, while there is room to say it."""
    for robot in robots.values():
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
    labels: Labels, document: PlanDocument, robots: dict[str, Pictured], size: float
) -> None:
    """Say at a crossing who waits there, while there is room to say it."""
    for crossing in document.crossings:
        who = robots.get(crossing.verdict.split(" ")[0])
        if who is not None:
            labels.place(
                crossing.verdict,
                (crossing.x, crossing.y),
                size=max(0.85 * size, _SMALLEST),
                colour=who.ink,
                optional=True,
            )


def _direction(ends: Array) -> Array:
    """Return the unit vector (2,) from the first to the last of points (n, 2)."""
    way = ends[-1] - ends[0]
    return np.asarray(way / max(float(np.hypot(*way)), 1e-12))
