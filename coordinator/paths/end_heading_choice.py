"""Which leads to try first at the ends of a path that has headings.

A lead is the few vertices next to an end that has a heading (end_headings.py).  Every pair of leads
is judged by an estimate of the time that the whole way takes: from its length, and from the time
lost by turning slowly at its ends.  For the part between the leads, the way of a robot without
headings is used; a straight line leads from a lead to the vertex of that way that makes the whole
shortest.

Decides: in which order leads are tried.  Must not know: which leads there are, and curves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Array
from coordinator.ground.corner_kernels import STRAIGHT, radius_of, turn_between, width_for
from coordinator.ground.free_space import Space
from coordinator.motion.cornering import Handling
from coordinator.paths.end_headings import STEP, Lead, leads
from coordinator.scenario.model import Robot

COMFORTABLE: Final = 0.25
"""Turns of this radius, as a share of the robot's, are wide enough if no radius is required."""

_SHARPEST: Final = math.radians(100.0)
"""A lead that turns by more [rad] at its end gets two turns there (sharp_turns.py)."""

_BLUNTED: Final = 4.0
"""Length of these two turns, per metre of their radius."""

_BEHIND: Final = -0.1
"""A turn around a circle may end up to this far [rad] past the direction to the place ahead."""

_UNSEEN: Final = 2.0
"""The distance to a place that is not in a lead's line of sight is multiplied by this."""

_RESERVE: Final = 1.15
"""The factor by which planned turns are wider than they should be at least."""

_SEEN: Final = 5
"""How many vertices of the way a lead may continue to, besides the last one."""

_KEPT: Final = 6
"""How many leads of each kind are tried at one end: straight ones, left and right turns."""

_ROOMY: Final = 2
"""How many more straight leads are tried, the longest of those that are left."""

_NO_RADIUS: Final = 1e-6
"""Turns on the spot count as turns of this radius [m]."""

_NONE: Final = Lead([], (0.0, 0.0), 0.0, 0.0, 0.0)

Leads = tuple[list[Array], list[Array]]


class _Joined(NamedTuple):
    """A lead, the time [s] that the whole way takes with it, and how much too tight its turns are.

    tight [m]: how much the radius of its turns falls short of what is wanted; 0 if it does not.
    """

    lead: Lead
    time: float
    tight: float


def choices(robot: Robot, space: Space, handling: Handling) -> list[Leads]:
    """Return pairs of leads, one at the start and one at the goal; the most promising pair first.

    The vertices of both leads are in the order of driving.  Raises PlanError if there is no
    room to move along a heading.
    """
    if len(robot.start) < 3 and len(robot.goal) < 3:
        return [([], [])]
    begin, end = np.array(robot.start[:2]), np.array(robot.goal[:2])
    way = space.shortest_way(begin, np.array(robot.via[0]) if robot.via else end)
    back = way[::-1] if way is not None else None
    if robot.via:
        back = space.shortest_way(end, np.array(robot.via[-1]))
    if way is None or back is None:
        return [([], [])]
    first = _joined(robot, robot.start, way, space, handling)
    if not robot.via:
        back = _met(back, first)
    last = _joined(robot, _reversed(robot.goal), back, space, handling)
    if not robot.via and len(robot.start) == len(robot.goal) == 3:
        first = _joined(robot, robot.start, _met(way, last), space, handling)
    pairs = list(product(first, last))
    keys = _together(pairs, way, space, _comfort(robot, handling), handling, not robot.via)
    pairs = [pairs[k] for k in sorted(range(len(pairs)), key=keys.__getitem__)]
    return [(a.lead.vertices, b.lead.vertices[::-1]) for a, b in pairs]


def _met(way: Array, others: Sequence[_Joined]) -> Array:
    """Return a way (n, 2) that ends at the last vertex of the best lead at its other end."""
    best = min(others, key=lambda one: (one.tight, one.time))
    return way if not best.lead.vertices else np.concatenate((way[:-1], [best.lead.last]))


def _together(
    pairs: Sequence[tuple[_Joined, _Joined]],
    way: Array,
    space: Space,
    comfort: float,
    handling: Handling,
    may_see: bool,
) -> list[tuple[float, float]]:
    """Return what pairs of leads lack [m] and take [s], by which they are sorted.

    way (n, 2) [m]: the way of a robot without headings.  `may_see`: whether a straight leg may join
    two leads; if one does, they are judged together.
    """
    ends = np.array([(a.lead.last, b.lead.last) for a, b in pairs])
    seen = np.zeros(len(pairs), np.bool_)
    if may_see and all(one.lead.vertices for one in pairs[0]):
        seen = space.keeping(ends[:, 0], ends[:, 1])
    alone, found = float(np.hypot(*np.diff(way, axis=0).T).sum()) / handling.speed, []
    for (a, b), is_seen in zip(pairs, seen.tolist(), strict=True):
        time = a.time + b.time - alone
        if is_seen:
            gap = math.dist(a.lead.last, b.lead.last)
            # Turns around one circle go on over the leg between them (smoothing.py).
            goes_on = a.lead.side == -b.lead.side != 0 and gap < 2.0 * a.lead.width
            share, left = 1.0 if goes_on else 0.5, gap + b.lead.length
            a = _judged(a.lead, b.lead.last, left, True, comfort, handling, share)
            b = _judged(b.lead, a.lead.last, 0.0, True, comfort, handling, share)
            time = a.time + b.time - b.lead.length / handling.speed
        found.append((a.tight + b.tight, time))
    return found


def _comfort(robot: Robot, handling: Handling) -> float:
    """Return the radius [m] that a robot's turns should have."""
    return max(handling.tightest, _RESERVE * COMFORTABLE * robot.radius)


def _joined(
    robot: Robot, pose: Sequence[float], way: Array, space: Space, handling: Handling
) -> list[_Joined]:
    """Return the most promising leads of one end.

    way (n, 2) [m]: the way from this end on, as a robot without headings would drive it.
    """
    rest = np.append(np.cumsum(np.hypot(*np.diff(way, axis=0).T)[::-1])[::-1], 0.0)
    if len(pose) < 3:
        return [_Joined(_NONE, float(rest[0]) / handling.speed, 0.0)]
    ahead, rest = way[1:], rest[1:]
    if len(ahead) > _SEEN + 1:
        ahead = np.concatenate((ahead[:_SEEN], ahead[-1:]))
        rest = np.append(rest[:_SEEN], 0.0)
    found = leads(robot, pose, ahead, space)
    if not found:
        end, told = ("start", robot.start) if pose is robot.start else ("goal", robot.goal)
        raise PlanError(
            f"no room to move along heading {told[-1]:.2f} rad at its {end} "
            f"({pose[0]:.2f}, {pose[1]:.2f})",
            place=(pose[0], pose[1]),
            helps="more room there or another heading",
        )
    ends = np.array([lead.last for lead in found])
    seen = space.keeping(np.repeat(ends, len(ahead), axis=0), np.tile(ahead, (len(found), 1)))
    gaps = np.hypot(*(ends[:, None] - ahead).transpose(2, 0, 1))
    seen = seen.reshape(gaps.shape)
    left = np.where(seen, 1.0, _UNSEEN) * gaps + rest
    comfort = _comfort(robot, handling)
    joined = [
        _judged(lead, ahead[k].tolist(), float(left[i, k]), bool(seen[i, k]), comfort, handling)
        for i, (lead, k) in enumerate(zip(found, left.argmin(axis=1).tolist(), strict=True))
    ]
    joined.sort(key=lambda one: (one.tight, one.time))
    straight, *turning = ([one for one in joined if one.lead.side == side] for side in (0, 1, -1))
    # A sharp turn that becomes two turns may need all the room that there is.
    roomy = sorted(straight[_KEPT:], key=lambda one: -one.lead.length)[:_ROOMY]
    return [*straight[:_KEPT], *roomy, *(one for side in turning for one in side[:_KEPT])]


def _judged(
    lead: Lead,
    ahead: Sequence[float],
    left: float,
    seen: bool,
    comfort: float,
    handling: Handling,
    share: float = 0.5,
) -> _Joined:
    """Judge a lead from which the way continues to the place `ahead` (2,).

    `left` [m]: the length of the way after the lead; `seen`: whether nothing is between the lead
    and that place; `comfort` [m]: the radius that turns should have.
    """
    x, y = ahead[0] - lead.last[0], ahead[1] - lead.last[1]
    turn = turn_between(math.cos(lead.heading), math.sin(lead.heading), x, y)
    length, radius = lead.length, lead.radius
    ahead_of_it = lead.side == 0 or _BEHIND <= lead.side * turn <= STEP + 0.02
    doubt = 0 if seen and ahead_of_it else 1 if ahead_of_it else 2
    if STRAIGHT < abs(turn) < _SHARPEST:
        wide = min(lead.width, share * math.hypot(x, y), width_for(handling.easy, turn))
        radius = min(radius, radius_of(wide, turn))
    elif abs(turn) >= _SHARPEST:
        doubt = max(doubt, 1)
        radius = min(radius, handling.easy, radius_of(lead.width, 0.5 * math.pi))
        left += _BLUNTED * radius
        length += _BLUNTED * radius
    time = (lead.length + left) / handling.speed + _lost(length, radius, handling)
    return _Joined(lead, time, doubt * comfort if doubt else max(comfort - radius, 0.0))


def _lost(length: float, radius: float, handling: Handling) -> float:
    """Return the time [s] that a turn over a length [m] next to a rest costs against full speed.

    From rest, at no more than v, the length takes length / v + v / (2 a); speeding up to the full
    speed V then takes (V - v) / a.
    """
    full, accel = handling.speed, handling.accel
    slow = min(
        full, math.sqrt(handling.lateral * max(radius, _NO_RADIUS)), math.sqrt(2.0 * accel * length)
    )
    slow = max(slow, 1e-3 * full)
    ramp = (slow + (full - slow) ** 2 / full - full) / (2.0 * accel)
    return length / slow - length / full + ramp


def _reversed(pose: Sequence[float]) -> Sequence[float]:
    """Return a pose as seen by somebody who drives the path from its end."""
    return pose if len(pose) < 3 else (pose[0], pose[1], pose[2] + math.pi)
