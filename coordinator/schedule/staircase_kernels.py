"""Compiled: the staircases of all pairs of robots that have conflict zones.

A conflict is a pair of plan times at which two robots would be too near.  For each cell of the path
of the robot behind, a zone gives the last arc length of the robot ahead in conflict with it.  Both
motions turn this into a step: from when the one enters the cell, the other has to have passed the
last time at which it is at that arc length.  The running maximum of the steps is the staircase,
which a polyline above it replaces.

Decides: on which side of a staircase rounding falls.  Must not know: fleets' names, messages.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from coordinator.base.compiled import allocation_free, compiled
from coordinator.curves.nurbs_kernels import Array, Indices
from coordinator.schedule.fleet_zone_kernels import widened
from coordinator.schedule.zone_kernels import CELL_NUMBER, HIGH, LOW, Polyline, zone_rows
from coordinator.schedule.zone_table_kernels import ZoneChords

_EVER: Final = 2**31 - 1
"""The need [ms] where the robot ahead rests in the conflict for ever."""

_MS: Final = 1000.0
_ALL: Final = (-math.inf, math.inf)
_BESIDE: Final = 1e-6
"""The path [m] right before and after a place of rest."""


AT, NEED = range(2)
"""Columns of steps and of knots: plan time of the robot behind, and of the one ahead [ms]."""


class Legs(NamedTuple):
    """Motions as legs of constant acceleration, those of robot r from first[r] to first[r + 1].

    t0, t1 [s], s0, s1 [m], v0, v1 [m/s]: at the beginning and the end of a leg; between legs, and
    after the last one, a robot rests.  since (robots,) [s]: before this a motion does not count.
    """

    first: Indices
    t0: Array
    t1: Array
    s0: Array
    s1: Array
    v0: Array
    v1: Array
    since: Array


class Pairing(NamedTuple):
    """Zones (z,) in order of their robots a < b, with the reach [m] of each pair.

    extent (z, 4) [m]: where a zone begins and ends on the path of a, and on that of b.
    """

    a: Indices
    b: Indices
    extent: Array
    reach: Array


class Steps(NamedTuple):
    """Staircases (n,): robots ahead and behind, where their knots begin (n + 1,), knots (k, 2)."""

    ahead: Indices
    behind: Indices
    first: Indices
    knots: Indices


@allocation_free
def _time_in(legs: Legs, leg: int, s: float) -> float:
    """Return when [s] a leg comes to arc length s [m], which lies on it."""
    passed = s - legs.s0[leg]
    if passed <= 0.0:
        return float(legs.t0[leg])
    v0, v1 = legs.v0[leg], legs.v1[leg]
    slope = (v1 * v1 - v0 * v0) / (legs.s1[leg] - legs.s0[leg])
    v = math.sqrt(max(v0 * v0 + slope * passed, 0.0))
    return float(min(legs.t0[leg] + 2.0 * passed / (v0 + v), legs.t1[leg]))


@allocation_free
def _first_time_at(legs: Legs, robot: int, s: float, leg: int) -> tuple[float, int]:
    """Return when [s] a robot comes to arc length s [m], inf beyond its goal, and on which leg.

    It is where it starts from the time on from which its motion counts.  The search for the leg
    begins at `leg`, one of the robot's.
    """
    if s <= 0.0:
        return float(legs.since[robot]), leg
    begin, end = legs.first[robot], legs.first[robot + 1]
    while leg > begin and legs.s1[leg - 1] >= s:
        leg -= 1
    while leg < end and legs.s1[leg] < s:
        leg += 1
    return (math.inf, max(leg - 1, begin)) if leg == end else (_time_in(legs, leg, s), leg)


@allocation_free
def _last_time_at(legs: Legs, robot: int, s: float, leg: int) -> tuple[float, int]:
    """Return when [s] a robot leaves arc length s [m], inf from its goal on, and on which leg.

    The search for the leg begins at `leg`, one of the robot's.
    """
    begin, end = legs.first[robot], legs.first[robot + 1]
    s = max(s, 0.0)
    while leg > begin and legs.s1[leg - 1] > s:
        leg -= 1
    while leg < end and legs.s1[leg] <= s:
        leg += 1
    return (math.inf, max(leg - 1, begin)) if leg == end else (_time_in(legs, leg, s), leg)


@allocation_free
def _is_through(
    legs: Legs, robots: tuple[int, int], extent: tuple[float, float], cell: float
) -> bool:
    """Return whether the first robot leaves a zone for good before the second one comes to it.

    extent [m]: where the first robot leaves the zone, and where the second one comes to it.
    """
    one, two = robots
    leaves, _ = _last_time_at(legs, one, extent[0] + cell, legs.first[one])
    comes, _ = _first_time_at(legs, two, extent[1] - cell, legs.first[two])
    return leaves < comes


@allocation_free
def _goes_first(
    legs: Legs, robots: tuple[int, int], begin: float, rows: Array, cell: float,
    span: tuple[float, float],
) -> bool:  # fmt: skip
    """Return whether the robot ahead surely goes first on a span [m] of its path.

    For the other arguments see _add_steps.
    """
    behind, ahead = robots
    enter, go = legs.first[behind], legs.first[ahead]
    for k in range(len(rows)):
        low, high = max(rows[k, LOW], span[0]), min(rows[k, HIGH], span[1])
        if low <= high:
            comes = max(begin, rows[k, CELL_NUMBER] * cell)
            enters, enter = _first_time_at(legs, behind, comes, enter)
            last, go = _last_time_at(legs, ahead, high, go)
            if last < enters:
                return True
    return False


@allocation_free
def _add_steps(
    legs: Legs, robots: tuple[int, int], begin: float, rows: Array, cell: float, steps: Indices,
    count: int, span: tuple[float, float],
) -> int:  # fmt: skip
    """Append the steps of a zone's rows unless the robot behind surely goes first.

    Returns how many steps there are.  robots: behind, ahead.  `begin` [m]: where the zone begins on
    the path of the robot behind, which may wait right before it for long.  Only a span [m] of the
    path of the robot ahead counts.
    """
    behind, ahead = robots
    is_behind, is_before, before = False, False, count
    enter = leave = legs.first[behind]
    come = go = legs.first[ahead]
    for k in range(len(rows)):
        number = rows[k, CELL_NUMBER]
        low, high = max(rows[k, LOW], span[0]), min(rows[k, HIGH], span[1])
        if low > high:
            continue
        enters, enter = _first_time_at(legs, behind, max(begin, number * cell), enter)
        last, go = _last_time_at(legs, ahead, high, go)
        is_behind |= last < enters
        if not is_behind and not is_before:
            leaves, leave = _last_time_at(legs, behind, (number + 1.0) * cell, leave)
            comes, come = _first_time_at(legs, ahead, low, come)
            is_before = leaves < comes
        if math.isinf(enters):
            continue
        steps[count, AT] = math.floor(_MS * enters) - 1
        steps[count, NEED] = _EVER if math.isinf(last) else math.ceil(_MS * last) + 1
        count += 1
    return before if is_before and not is_behind else count


@allocation_free
def _ends_at_rest(legs: Legs, robot: int, leg: int) -> bool:
    """Return whether a robot rests where one of its legs ends."""
    return bool(leg + 1 == legs.first[robot + 1] or legs.t0[leg + 1] > legs.t1[leg])


@allocation_free
def _rests_within(legs: Legs, robot: int, low: float, high: float) -> bool:
    """Return whether a robot rests, on its way or at its goal, between two arc lengths [m]."""
    for leg in range(legs.first[robot], legs.first[robot + 1]):
        if low <= legs.s1[leg] <= high and _ends_at_rest(legs, robot, leg):
            return True
    return False


@compiled
def _add_between_rests(
    legs: Legs, robots: tuple[int, int], begin: float, rows: Array, bare: Array, cell: float,
    steps: Indices, count: int,
) -> tuple[Indices, int]:  # fmt: skip
    """Append the steps of those parts of a zone where the robot ahead surely goes first.

    The parts are between its places of rest.  Returns the steps, in memory that may be new, and how
    many there are.  `bare`: rows like `rows`, but with what robots need for their reach.
    """
    low, ahead = -math.inf, robots[1]
    for leg in range(legs.first[ahead], legs.first[ahead + 1]):
        if not _ends_at_rest(legs, ahead, leg):
            continue
        span = (low, legs.s1[leg] - _BESIDE)
        if _goes_first(legs, robots, begin, bare, cell, span):
            steps = widened(steps, count + len(rows))
            count = _add_steps(legs, robots, begin, rows, cell, steps, count, span)
        low = legs.s1[leg] + _BESIDE
    return steps, count


@compiled
def _climb(steps: Indices) -> Indices:
    """Return the running maximum of steps as the corners (m, 2) of a polyline on or above it."""
    order = np.argsort(steps[:, AT], kind="mergesort")
    corners, count, need = np.empty((2 * len(steps), 2), np.int64), 0, -(2**62)
    for at, step in steps[order]:
        if step <= need:
            continue
        if count and corners[count - 1, AT] == at:
            count -= 1
        elif count and at - corners[count - 1, AT] > 1 and step > need:
            corners[count, AT], corners[count, NEED] = at - 1, need
            count += 1
        corners[count, AT], corners[count, NEED] = at, step
        need, count = step, count + 1
    return corners[:count]


@compiled
def _simplify(corners: Indices, tolerance: int, knots: Indices) -> int:
    """Write a polyline with few knots on or above corners, at most `tolerance` [ms] above them.

    From each knot the next one is as far as one line stays within the tolerance (swing filter).
    Returns how many knots there are, at most as many as corners.
    """
    knots[0] = corners[0]
    count, at, need = 1, corners[0, AT], corners[0, NEED]
    low, high, k = 0.0, math.inf, 1
    while k < len(corners):
        passed, rise = corners[k, AT] - at, corners[k, NEED] - need
        least, most = max(low, rise / passed), min(high, max(rise + tolerance, 0) / passed)
        if least <= most:
            low, high, k = least, most, k + 1
            if k < len(corners):
                continue
        need += math.ceil(low * (corners[k - 1, AT] - at))
        at = corners[k - 1, AT]
        knots[count, AT], knots[count, NEED] = at, need
        count, low, high = count + 1, 0.0, math.inf
    return count


@compiled
def staircases(
    legs: Legs, first: Indices, lines: Polyline, zones: Pairing, chords: ZoneChords, fine: float,
    tolerance: int, spare: float,
) -> Steps:  # fmt: skip
    """Return the staircases of all pairs of robots with zones.

    The vertices of all robots' paths are in `lines`, those of robot r from first[r] to
    first[r + 1].  `fine` [m] is the length of a cell, `tolerance` [ms] by how much a staircase may
    lie above its steps.

    `spare` [m]: how much of the reach is more than robots need.  Who goes first is the same all
    over a zone, but not where that is spare: a robot may go first, rest there while the other one
    passes, and go second.  Then the parts of a zone before and after that rest count apart.
    """
    ahead, behind = np.empty((256, 1), np.int64), np.empty((256, 1), np.int64)
    begins, knots = np.zeros((257, 1), np.int64), np.empty((4096, 2), np.int64)
    rows, steps, pairs, zone = np.empty((1024, 3)), np.empty((1024, 2), np.int64), 0, 0
    spans = np.empty((1024, 2))
    s, points = lines
    while zone < len(zones.a):
        a, b, end = zones.a[zone], zones.b[zone], zone + 1
        while end < len(zones.a) and zones.a[end] == a and zones.b[end] == b:
            end += 1
        for side in range(2):
            me, other = (a, b) if side == 0 else (b, a)
            mine, theirs = slice(first[me], first[me + 1]), slice(first[other], first[other + 1])
            my_line, its = Polyline(s[mine], points[mine]), Polyline(s[theirs], points[theirs])
            count = 0
            for k in range(zone, end):
                begin, leaves = zones.extent[k, 2 * side], zones.extent[k, 2 * side + 1]
                if _is_through(legs, (me, other), (leaves, zones.extent[k, 2 - 2 * side]), fine):
                    continue
                here = chords.pairs[chords.first[k] : chords.first[k + 1]]
                spans = widened(spans, len(here))
                size = zone_rows(my_line, its, here, side, zones.reach[k], fine, rows, spans)
                if size < 0:
                    rows = np.empty((-2 * size, 3))
                    size = zone_rows(my_line, its, here, side, zones.reach[k], fine, rows, spans)
                steps = widened(steps, count + size)
                robots, before = (me, other), count
                count = _add_steps(legs, robots, begin, rows[:size], fine, steps, count, _ALL)
                low, high = zones.extent[k, 2 - 2 * side], zones.extent[k, 3 - 2 * side]
                if count > before or not _rests_within(legs, other, low + fine, high):
                    continue
                bare, need = np.empty((size, 3)), zones.reach[k] - spare
                bare = bare[: zone_rows(my_line, its, here, side, need, fine, bare, spans)]
                steps, count = _add_between_rests(
                    legs, robots, begin, rows[:size], bare, fine, steps, count
                )
            if count == 0:
                continue
            corners = _climb(steps[:count])
            past = begins[pairs, 0]
            knots = widened(knots, past + len(corners))
            ahead, behind = widened(ahead, pairs + 1), widened(behind, pairs + 1)
            begins = widened(begins, pairs + 2)
            ahead[pairs, 0], behind[pairs, 0] = other, me
            begins[pairs + 1, 0] = past + _simplify(corners, tolerance, knots[past:])
            pairs += 1
        zone = end
    return Steps(
        ahead[:pairs, 0].copy(),
        behind[:pairs, 0].copy(),
        begins[: pairs + 1, 0].copy(),
        knots[: begins[pairs, 0]].copy(),
    )
