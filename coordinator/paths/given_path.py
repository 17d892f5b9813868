"""Making the curve that a robot drives from a given path, or explaining why it cannot drive it.

Decides: how a given curve is changed (float32, rounded corners) and which limits and clearance it
must satisfy.  Must not know: files, other robots, times.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np
import shapely

from coordinator.base.errors import PlanError
from coordinator.curves.bounds import flatten
from coordinator.curves.knots import piece, refine
from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.curves.nurbs_kernels import parameters_at
from coordinator.curves.splines import joined
from coordinator.paths.corners import corners, rounded, still
from coordinator.plan.path_parts import whole
from coordinator.plan.wire import measured
from coordinator.scenario.floor import Floor
from coordinator.scenario.model import GivenPath, Robot, Scenario
from coordinator.scenario.place_checks import LEAST_STEP

_ODD_SCALE: Final = 1e3
"""Knots are rescaled only if their unit differs from a metre by more than this factor; so are
weights, relative to 1."""

_FLAT: Final = 2e-4
_SHORTFALL: Final = 1e-3
"""Greatest deviation [m] of the polyline on which clearance is checked, and the shortfall [m] of
clearance that the proof accepts."""

_STEP: Final = 0.01
_MOST_PLACES: Final = 50_000
"""Messages locate the place that is nearest to something solid in steps of _STEP [m]; the steps are
longer if a path would have more than _MOST_PLACES places."""

_HALVINGS: Final = 6
_ARC_ERROR: Final = 1e-4
"""Knot spans are halved, at most _HALVINGS times, until arc lengths have at most this error [m]."""

_LOOKS: Final = 256
"""Places per knot span at which a curve is looked at for sharp turns."""

_CUSP: Final = 0.1
_SHARPEST: Final = 1e-3
"""If the direction turns by more than _CUSP [rad] between two such places, with a radius below
_SHARPEST [m], the robot would turn on the spot."""

_TURN: Final = 1.02
"""A turn is refused here if min_turn_radius exceeds its radius by more than this factor.  The proof
allows only 1.01, so such a turn would surely fail the proof."""


def curve_of(path: GivenPath) -> Nurbs:
    """Return a path as a curve in the numbers of the wire (float32), with corners rounded."""
    curve = exact(path)
    if not np.ptp(curve.points, axis=0).max() > LEAST_STEP:
        raise PlanError("its path has no length")
    if path.rounding > 0.0:
        curve = rounded(curve, path.rounding)
    curve = _measurable(_even(curve))
    single = (array.astype(np.float32) for array in (curve.knots, curve.points, curve.weights))
    return nurbs(curve.degree, *single)


def exact(path: GivenPath) -> Nurbs:
    """Return the given curve unchanged, except that unusual scales of knots or weights change."""
    full = whole(path)
    curve = nurbs(full.degree, full.knots, full.control_points, full.weights)
    knots, weights, length = curve.knots, curve.weights, max(_polygon_length(curve), LEAST_STEP)
    if not length / _ODD_SCALE <= knots[-1] <= length * _ODD_SCALE:
        knots = knots / knots[-1] * length
    if not 1.0 / _ODD_SCALE <= weights.max() <= _ODD_SCALE:
        weights = weights / weights.max()
    return nurbs(curve.degree, knots, curve.points, weights)


def _even(curve: Nurbs) -> Nurbs:
    """Return the same curve, reparametrized where the speed of its parameter jumps.

    Robots approximate arc length by cubic pieces between knots; a jump in speed makes these wrong.
    """
    own, times = np.unique(curve.knots, return_counts=True)
    cuts = [0.0, *own[1:-1][times[1:-1] >= curve.degree].tolist(), float(own[-1])]
    parts = [piece(curve, *ends) for ends in pairwise(cuts)]
    moving = [part for part in parts if _polygon_length(part) > 0.0]
    return joined(moving) if len(parts) > 1 else curve


def _measurable(curve: Nurbs) -> Nurbs:
    """Return the same curve with knots inserted until robots compute arc lengths accurately."""
    for _ in range(_HALVINGS):
        table = measured(curve)
        middles = 0.5 * (table.s[:-1] + table.s[1:])
        found = parameters_at(*table, middles)
        rough = found[np.abs(curve.arc_at(found) - middles) > _ARC_ERROR]
        if len(rough) == 0:
            break
        borders = np.unique(curve.knots)
        spans = np.unique(np.clip(np.searchsorted(borders, rough) - 1, 0, len(borders) - 2))
        curve = refine(curve, 0.5 * (borders[spans] + borders[spans + 1]))
    return curve


def _polygon_length(curve: Nurbs) -> float:
    legs = np.diff(curve.points, axis=0)
    return float(np.hypot(legs[:, 0], legs[:, 1]).sum())


def path_of(curve: Nurbs) -> GivenPath:
    """Return a curve as a path to be driven as it is."""
    return GivenPath(
        degree=curve.degree,
        control_points=tuple((x, y) for x, y in curve.points.tolist()),
        knots=tuple(curve.knots.tolist()),
        weights=() if (curve.weights == 1.0).all() else tuple(curve.weights.tolist()),
    )


def given_curve(robot: Robot, path: GivenPath, margin: float, floor: Floor | None) -> Nurbs:
    """Return the curve of a robot's given path; raises PlanError if it cannot be driven.

    Clearance is not checked where the `floor`, the margin [m] or the robot's radius is unknown.
    """
    curve = curve_of(path)
    told = list(complaints(curve, robot, margin, floor))
    if told:
        raise PlanError("its path " + ", and ".join(told))
    return curve


def path_problems(scenario: Scenario, has_floor: bool = True) -> list[str]:
    """Return why given paths cannot be driven, one line per robot.

    A path without control points was invalid as such.  `has_floor`: whether the workspace is valid.
    """
    space = scenario.workspace
    floor = Floor(space.boundary, space.obstacles) if has_floor else None
    problems = []
    for index, robot in enumerate(scenario.robots):
        if robot.path is not None and robot.path.control_points:
            try:
                given_curve(robot, robot.path, scenario.margin, floor)
            except PlanError as error:
                field = f"robots[{index}]"
                name = "" if robot.id in ("", field) else f"{robot.id}: "
                problems.append(f"{field}.path: {name}{error}")
    return problems


def complaints(curve: Nurbs, robot: Robot, margin: float, floor: Floor | None) -> Iterator[str]:
    """Yield why a robot cannot drive a curve: too sharp turns, too little clearance; margin [m]."""
    turns: list[str] = []
    if math.isfinite(robot.max_lateral_accel) or robot.min_turn_radius > 0.0:
        turns = list(_turns(curve, robot.min_turn_radius))
    for x, y in [] if turns else still(curve)[:1]:
        turns = [f"has no direction at ({x:.2f}, {y:.2f}), where control points are repeated"]
    yield from turns
    if floor is None or not math.isfinite(robot.radius + margin):
        return
    chain = flatten(curve, _FLAT)
    clearance = floor.gap(chain.points) - chain.bound - robot.radius
    if clearance < margin - _SHORTFALL:
        yield _say_clearance(chain.points, robot.radius + margin, floor)


def _turns(curve: Nurbs, least: float) -> Iterator[str]:
    """Yield the sharpest of the turns that a robot cannot drive; `least` radius [m].

    The proof decides rigorously about bends; this early check says what is wrong and where.
    """
    found = corners(curve)
    if found:
        sharpest = max(found, key=lambda corner: corner.turn)
        x, y = sharpest.place
        yield (
            f"turns on the spot by {math.degrees(sharpest.turn):.0f} degrees at ({x:.2f}, {y:.2f});"
            " path.rounding says by how much corners of straight legs may be cut"
        )
        return
    borders = np.unique(curve.knots)
    parts = np.linspace(0.0, 1.0, _LOOKS, endpoint=False)
    u = (borders[:-1, None] + np.diff(borders)[:, None] * parts).ravel()
    places, first = curve.derivatives(u, 1)
    (ax, ay), (bx, by) = first[:-1].T, first[1:].T
    turns = np.abs(np.arctan2(ax * by - ay * bx, ax * bx + ay * by))
    steps = np.hypot(*np.diff(places, axis=0).T)
    cusps = np.flatnonzero((turns > _CUSP) & (steps < _SHARPEST * turns))
    for x, y in places[cusps[:1]]:
        yield f"turns on the spot at ({x:.2f}, {y:.2f})"
    bends = np.abs(curve.curvature(u))
    x, y = places[np.argmax(bends)]
    if len(cusps) == 0 and bends.max() * least > _TURN:
        yield (
            f"bends with a radius of {1.0 / bends.max():.3f} m at ({x:.2f}, {y:.2f}), "
            f"min_turn_radius is {least:g} m"
        )


def _say_clearance(line: Array, need: float, floor: Floor) -> str:
    """Say where a polyline (n, 2) is nearest to something solid, or farthest off the floor."""
    places = _places(line)
    place = places[np.argmin(_slack(places, floor))]
    x, y = place
    here = shapely.Point(place)
    edge = floor.outline.exterior.distance(here)
    if not floor.outline.covers(here):
        return f"leaves the floor near ({x:.2f}, {y:.2f})"
    gap = float(floor.distance(place[None])[0])
    what = "the floor's edge" if edge <= gap else "an obstacle"
    if gap <= 0.0:
        return f"leads through {what} near ({x:.2f}, {y:.2f})"
    return f"comes within {gap:.3f} m of {what} near ({x:.2f}, {y:.2f}), it needs {need:g} m"


def _slack(places: Array, floor: Floor) -> Array:
    """Return the distance [m] of each place from anything solid (m,); negative off the floor."""
    off = shapely.distance(floor.outline, shapely.points(places))
    return np.where(off > 0.0, -off, floor.distance(places))


def _places(line: Array) -> Array:
    """Return the vertices of a polyline and places between them, (m, 2), a step apart at most."""
    arcs = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    count = min(1 + math.ceil(arcs[-1] / _STEP), _MOST_PLACES)
    s = np.union1d(arcs, np.linspace(0.0, arcs[-1], count))
    return np.column_stack([np.interp(s, arcs, line[:, axis]) for axis in (0, 1)])
