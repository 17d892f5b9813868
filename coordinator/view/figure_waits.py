"""Draws why a robot waits: the arc lengths and times that others forbid it, and its way past them.

Robot i forbids (t, s) to robot j if, for some t' with |t - t'| <= tau, the centres of j at arc
length s and of i at time t' are nearer than r_i + r_j + margin.  The regions are computed on a grid
from the plan as sent.  They are an illustration; the proof is proof/tau_safety.py.  Decides: the
regions and how they look.  Must not know: the page.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox
from scipy import ndimage

from coordinator.curves.nurbs import Array
from coordinator.findings.wait_summary import longest, waits_of
from coordinator.plan.document import PlanDocument
from coordinator.view.figure_forbidden import forbidden
from coordinator.view.figure_robots import Pictured
from protocol.timeline import Timeline

_PANELS: Final = 6
_ROWS: Final = 220
_COLUMNS: Final = 480
_SAID: Final = 3
"""A panel states what this many waits, the longest, would cost in the reverse precedence."""
_OTHERS: Final = 0.28
"""Opacity of forbidden regions; the parts that force a wait are shaded once more."""
_LABELLED: Final = 0.004
"""A region is named if it takes this share of the panel, or if the robot waits because of it."""

Mask = npt.NDArray[np.bool_]


def explanation(waiting: Sequence[Pictured], document: PlanDocument) -> str:
    """Return a text that explains what the panels of the waiting robots show."""
    names = {robot.id for robot in waiting}
    forced = any(reason.robot in names for reason in document.waits)
    strongly = "; strongly: to the robot that it waits for" if forced else ""
    said = (
        "Shaded: where and when the waiting robot would come nearer than radii + margin to another "
        f"one that is up to tau early or late{strongly}.\nDotted: its way without the waits."
    )
    if forced:
        said += (
            "  Other way round: how much later both would arrive in total if the other one waited."
        )
    return said


def longest_waits(robots: dict[str, Pictured]) -> list[Pictured]:
    """Return the robots that wait longest, at most six, in the plan's order."""
    waiting = [robot for robot in robots.values() if robot.pauses]
    chosen = sorted(waiting, key=lambda robot: -robot.waits)[:_PANELS]
    return [robot for robot in waiting if robot in chosen]


def draw_wait(
    axes: Axes, robot: Pictured, robots: dict[str, Pictured], document: PlanDocument
) -> None:
    """Draw a robot's arc length over time, and the regions that the others forbid it."""
    end = 1.04 * robot.plan.finish_time
    times = np.linspace(0.0, end, _COLUMNS, dtype=np.float64)
    places = np.linspace(0.0, robot.driven.curve.length, _ROWS, dtype=np.float64)
    axes.set(xlim=(0.0, end), ylim=(0.0, 1.03 * places[-1]))
    _draw_regions(axes, robot, robots, document, times, places)
    _draw_reasons(axes, robot, robots, document)
    profile = robot.plan.profile
    alone = Timeline([s for s, _ in profile], [v for _, v in profile], [], [])
    axes.plot(times, [alone.s_at(t) for t in times.tolist()], color="#555555", lw=0.9, ls=":")
    axes.plot(times, robot.progress(times), color=robot.colour, lw=2.2, zorder=5)
    axes.tick_params(labelsize=8, length=3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("plan time [s]", size=8.5)
    axes.set_ylabel(f"{robot.id} along its path [m]", size=8.5)
    said = [
        f"{until - since:.1f} s for {owner}" if owner else f"{until - since:.1f} s"
        for _, since, until, owner in robot.pauses
    ]
    title = f"{robot.id} waits {', '.join(said[:2])}{', ...' if len(said) > 2 else ''}"
    axes.set_title(
        title, size=10, color=robot.ink, weight="bold", loc="left", pad=17 if document.waits else 5
    )
    _say_costs(axes, robot, document)


def nearest_within(
    robot: Pictured, other: Pictured, tau: float, times: Array, places: Array
) -> Array:
    """Return how near another robot comes within tau [s], (len(places), len(times)) [m].

    `times` (n,) [s] are equally spaced from 0, `places` (m,) [m] are on the robot's own path.
    Only these times are compared, so a distance is accurate to the way driven in one step.
    """
    step = float(times[1] - times[0])
    reach = math.floor(min(tau / step, len(times)))
    wider = np.arange(-reach, len(times) + reach, dtype=np.float64) * step
    theirs = other.driven.curve.at_arc(other.progress(wider))
    mine = robot.driven.curve.at_arc(places)
    across, up = (mine[:, axis, None] - theirs[:, axis] for axis in (0, 1))
    distance = np.sqrt(across * across + up * up)
    nearest = ndimage.minimum_filter1d(distance, 2 * reach + 1, axis=1)
    return np.asarray(nearest[:, reach : reach + len(times)])


def _draw_regions(
    axes: Axes,
    robot: Pictured,
    robots: dict[str, Pictured],
    document: PlanDocument,
    times: Array,
    places: Array,
) -> None:
    """Shade what each other robot forbids, and write its name there.

    Robots that are waited for are named, and those of larger regions if there is room.
    """
    regions: list[tuple[Pictured, Mask]] = []
    for other in robots.values():
        need = robot.plan.radius + other.plan.radius + document.margin
        if other is robot or _far_apart(robot, other, need):
            continue
        near = nearest_within(robot, other, document.tau, times, places)
        mask = near < need
        if mask.any():
            colours = [other.colour]
            rows, columns = (_around(np.flatnonzero(mask.any(axis=axis))) for axis in (1, 0))
            part = (times[columns], places[rows], near[rows, columns])
            axes.contourf(*part, [-1.0, need], colors=colours, alpha=_OTHERS)
            axes.contour(*part, [need], colors=colours, linewidths=0.7)
            regions.append((other, mask))
    crowd = sum((mask.astype(int) for _, mask in regions), np.zeros((_ROWS, _COLUMNS), int))
    owners = {owner for *_, owner in robot.pauses}
    regions.sort(key=lambda region: (region[0].id not in owners, -int(region[1].sum())))
    named: list[Bbox] = []
    for other, mask in regions:
        least = 0.0 if other.id in owners else _LABELLED
        for row, column in _spots(mask, crowd, least):
            _name(axes, other, (float(times[column]), float(places[row])), named)


def _draw_reasons(
    axes: Axes, robot: Pictured, robots: dict[str, Pictured], document: PlanDocument
) -> None:
    """Shade the regions that force the waits once more."""
    for reason in document.waits:
        other = robots.get(reason.yields_to)
        if reason.robot == robot.id and other is not None and other is not robot:
            region = forbidden(robot.driven, other.driven, reason, document)
            begin, end = (np.clip(t, *axes.get_xlim()) for t in (region.begin, region.end))
            style: dict[str, Any] = {"fc": other.colour, "alpha": _OTHERS, "gid": "forbidden"}
            axes.fill_betweenx(region.s, begin, end, ec=other.ink, lw=1.2, zorder=3, **style)


def _say_costs(axes: Axes, robot: Pictured, document: PlanDocument) -> None:
    """Write below the title what it would cost if the other robots waited instead."""
    told = longest([wait for wait in waits_of(document) if wait.robot == robot.id], _SAID)
    if told:
        costs = ", ".join(f"{wait.yields_to} {wait.other_way}" for wait in told)
        said = f"other way round: {costs}"
        place: dict[str, Any] = {"xycoords": "axes fraction", "textcoords": "offset points"}
        axes.annotate(said, (0.0, 1.0), (0.0, 4.0), size=8.5, color="#444444", **place)


def _name(axes: Axes, other: Pictured, spot: tuple[float, float], named: list[Bbox]) -> None:
    """Write a robot's name into its region unless it would cover one of the boxes `named` [px]."""
    style: dict[str, Any] = {
        "size": 8,
        "weight": "bold",
        "ha": "center",
        "va": "center",
        "zorder": 4,
    }
    label = axes.text(*spot, other.id, color=other.ink, **style)
    box = label.get_window_extent()
    if any(box.overlaps(one) for one in named):
        label.remove()
    else:
        named.append(box)


def _around(found: npt.NDArray[np.intp]) -> slice:
    """Return the range from the first to the last index found, widened by one at each end."""
    return slice(max(int(found[0]) - 1, 0), int(found[-1]) + 2)


def _spots(mask: Mask, crowd: npt.NDArray[np.int_], least: float) -> list[tuple[int, int]]:
    """Return the (row, column) deepest inside each larger part, off other regions if possible."""
    parts, count = ndimage.label(mask)
    spots = []
    for part in range(1, count + 1):
        inside = parts == part
        if inside.mean() < least:
            continue
        depth = _depth(inside & (crowd == 1))
        if depth.max() < 8.0:
            depth = _depth(inside)
        row, column = np.unravel_index(int(np.argmax(depth)), depth.shape)
        spots.append((int(row), int(column)))
    return spots


def _depth(inside: Mask) -> Array:
    """Return the distance of each cell from the outside, in cells."""
    return np.asarray(ndimage.distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1])


def _far_apart(robot: Pictured, other: Pictured, need: float) -> bool:
    """Return whether the control polygons, and so the paths, are farther apart than the need."""
    mine, theirs = (np.array(one.plan.path.control_points) for one in (robot, other))
    gap = np.maximum(mine.min(axis=0) - theirs.max(axis=0), theirs.min(axis=0) - mine.max(axis=0))
    return bool(np.any(gap > need))
