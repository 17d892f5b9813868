"""The staircases of a plan, from the curves and motions that its messages carry.

Decides: which pairs have a staircase, and how fine it is.  Must not know: who drives, proofs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import shapely

from coordinator.base.kept import kept
from coordinator.curves.chords import Chords, chords_of
from coordinator.curves.nurbs import Nurbs
from coordinator.plan.course import Course
from coordinator.plan.document import PlanDocument
from coordinator.plan.staircases import Staircases
from coordinator.plan.wire import Driven, PackedPlan
from coordinator.schedule.conflict_zones import find_zones
from coordinator.schedule.staircase_kernels import AT, NEED, Legs, Pairing, staircases
from coordinator.schedule.zone_kernels import Polyline
from coordinator.schedule.zone_table_kernels import ZoneChords

_CELL: Final = 0.01
"""Length [m] of the cells of a path; at 1 m/s a robot passes one in 10 ms."""

_TOLERANCE: Final = 20
"""By how much [ms] a staircase may lie above its steps, so that it has few knots."""

_CHORD_ERROR: Final = 1e-3
"""How far [m] chords may lie off their paths here; staircases ask for that much more distance."""

STANDOFF: Final = 0.005
"""How much more distance [m] than the margin staircases ask for: a robot that stands at the end of
its authority is not quite still, and the next plan needs the whole margin around it."""

_ROUNDING: Final = 1e-6
"""So much less distance [m] than is left where a course begins is asked for."""


def with_staircases(plan: PackedPlan) -> PackedPlan:
    """Return a plan with the staircases of its robots, which are not proven yet.

    A robot that is held stands STANDOFF short of its conflict, so that a new plan can start there.
    Raises PartsError naming the robots that would refuse their messages.
    """
    terms = plan.document
    return plan.bounded_by(staircases_of(plan.driven, terms.tau, terms.margin + STANDOFF))


def staircases_among(course: Course, near: Sequence[Course], terms: PlanDocument) -> Staircases:
    """Return the staircases of a course, index 0, with others, from index 1 on.

    They ask for STANDOFF more than the margin.  A robot that was held stands about as far from
    another one's path: where the course begins nearer, they ask for what is left there.  Nobody
    waits for robots that stand at their ends.
    """
    places = np.array([0, *(k for k, one in enumerate(near, start=1) if not one.has_ended)])
    courses = [course, *(near[k - 1] for k in places[1:].tolist())]
    driven, since = [one.driven for one in courses], [one.since for one in courses]
    reach = terms.margin + STANDOFF
    paths = [_chords_of(one.curve) for one in driven]
    radii = np.array([one.radius for one in driven])
    errors = np.array([path.error for path in paths])
    start = shapely.Point(paths[0].points[0])
    ways = [shapely.linestrings(path.points) for path in paths[1:]]
    left = shapely.distance(start, ways) - (radii + errors)[1:] - radii[0] - errors[0] - _ROUNDING
    less = np.where(left < terms.margin, 0.0, np.maximum(reach - left, 0.0))
    found = staircases_of(driven, terms.tau, reach, (0,), since, less=[0.0, *less])
    return replace(found, ahead=places[found.ahead], behind=places[found.behind])


def staircases_of(
    driven: Sequence[Driven],
    tau: float,
    margin: float,
    among: Sequence[int] | None = None,
    since: Sequence[float] | None = None,
    *,
    less: Sequence[float] | None = None,
) -> Staircases:
    """Return the staircases of all pairs of robots that come near each other; tau [s], margin [m].

    `among`: only pairs with at least one of these robots (indices).  `since` [s]: from when motions
    count, by default from their beginnings.  `less` [m]: how much less distance each robot needs.
    """
    paths = [_chords_of(one.curve) for one in driven]
    radii = np.array([one.radius for one in driven]) - (0.0 if less is None else np.asarray(less))
    errors = np.array([path.error for path in paths])
    zones = find_zones(paths, radii, margin, among=among)
    half = radii + 0.5 * margin + errors
    found = staircases(
        _legs_of(driven, since),
        np.cumsum([0, *(len(path.s) for path in paths)]),
        Polyline(
            np.concatenate([path.s for path in paths]),
            np.concatenate([path.points for path in paths]),
        ),
        Pairing(zones.a, zones.b, zones.extent, half[zones.a] + half[zones.b]),
        ZoneChords(zones.first, zones.pairs),
        _CELL,
        _TOLERANCE,
    )
    order = np.lexsort((found.ahead, found.behind))
    sizes = np.diff(found.first)[order]
    first = np.append(0, np.cumsum(sizes))
    rows = np.arange(first[-1]) + np.repeat(found.first[:-1][order] - first[:-1], sizes)
    knots = found.knots[rows].astype(np.int32)
    return Staircases(
        tau_ms=int(1000.0 * tau),
        ahead=found.ahead[order],
        behind=found.behind[order],
        first=first,
        at=knots[:, AT].copy(),
        need=knots[:, NEED].copy(),
    )


@kept
def _chords_of(curve: Nurbs) -> Chords:
    return chords_of(curve, _CHORD_ERROR)


def _legs_of(driven: Sequence[Driven], since: Sequence[float] | None) -> Legs:
    legs = np.concatenate([one.legs for one in driven], axis=1)
    columns = dict(zip(("t0", "t1", "s0", "s1", "v0", "v1"), legs, strict=True))
    begins = [0.001 * one.plan.begin_ms for one in driven] if since is None else since
    return Legs(
        np.cumsum([0, *(one.legs.shape[1] for one in driven)]), since=np.array(begins), **columns
    )
