"""The staircases of a plan, from the curves and motions that its messages carry.

Decides: which pairs have a staircase, and how fine it is.  Must not know: who drives, proofs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
import shapely

from coordinator.base.kept import kept
from coordinator.curves.chords import Chords, chords_of
from coordinator.curves.nurbs import Array, Nurbs
from coordinator.curves.nurbs_kernels import Indices
from coordinator.plan.course import Course
from coordinator.plan.document import PlanDocument
from coordinator.plan.staircases import Staircases
from coordinator.plan.wire import Driven, PackedPlan
from coordinator.schedule.conflict_zones import Zones, find_zones
from coordinator.schedule.staircase_kernels import AT, NEED, Legs, Pairing, Steps, staircases
from coordinator.schedule.zone_kernels import Polyline
from coordinator.schedule.zone_table_kernels import ZoneChords

_CELL: Final = 0.01
"""Length [m] of the cells of a path; at 1 m/s a robot passes one in 10 ms."""

_TOLERANCE: Final = 20
"""By how much [ms] a staircase may lie above its steps, so that it has few knots."""

_MUCH: Final = 500.0
"""Cells and tolerance are twice as long if the paths that are asked for lead through more than so
many metres of zones in the mean: among hundreds of robots, but not among 100."""

_CHORD_ERROR: Final = 1e-3
"""How far [m] chords may lie off their paths here; staircases ask for that much more distance."""

_PART: Final = 2_000
_MOST_PARTS: Final = 24
"""At least how many pairs are in one task, unless there are fewer, and the most tasks."""

STANDOFF: Final = 0.005
"""How much more distance [m] than the margin staircases ask for: a robot that stands at the end of
its authority is not quite still, and the next plan needs the whole margin around it."""

_ROUNDING: Final = 1e-6
"""So much less distance [m] than is left where a course begins is asked for."""


def with_staircases(plan: PackedPlan, executor: Executor | None = None) -> PackedPlan:
    """Return a plan with the staircases of its robots, which are not proven yet.

    A robot that is held stands STANDOFF short of its conflict, so that a new plan can start there.
    Raises PartsError naming the robots that would refuse their messages.
    """
    terms, reach = plan.document, plan.document.margin + STANDOFF
    return plan.bounded_by(staircases_of(plan.driven, terms.tau, reach, executor=executor))


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
    ways, wide = np.array([_line_of(one.curve) for one in driven[1:]], object), radii + errors
    may_lack = shapely.dwithin(start, ways, wide[1:] + wide[0] + reach + _ROUNDING)
    left = np.full(len(ways), math.inf)
    left[may_lack] = shapely.distance(start, ways[may_lack]) - wide[1:][may_lack]
    left = left - radii[0] - errors[0] - _ROUNDING
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
    executor: Executor | None = None,
) -> Staircases:
    """Return the staircases of all pairs of robots that come near each other; tau [s], margin [m].

    `among`: only pairs with at least one of these robots (indices).  `since` [s]: from when motions
    count, by default from their beginnings.  `less` [m]: how much less distance each robot needs.
    The executor gets tasks of plain arrays; the result does not depend on it.
    """
    paths = [_chords_of(one.curve) for one in driven]
    radii = np.array([one.radius for one in driven]) - (0.0 if less is None else np.asarray(less))
    errors = np.array([path.error for path in paths])
    zones = find_zones(paths, radii, margin, executor, among)
    half = radii + 0.5 * margin + errors
    lines = Polyline(
        np.concatenate([path.s for path in paths]), np.concatenate([path.points for path in paths])
    )
    fleet = (_legs_of(driven, since), np.cumsum([0, *(len(path.s) for path in paths)]), lines)
    asked = 0.5 * len(driven) if among is None else len(among)
    is_much = 0.5 * float(np.diff(zones.extent.reshape(-1, 2, 2)).sum()) > _MUCH * asked
    scale = 2 if is_much else 1
    tasks = [_task(zones, half, *borders) for borders in _borders(zones)]
    if executor is None or len(tasks) == 1:
        parts = [_steps(*fleet, *task, scale) for task in tasks]
    else:
        waiting = [executor.submit(_steps, *fleet, *task, scale) for task in tasks]
        parts = [future.result() for future in waiting]
    return _in_order(parts, int(1000.0 * tau))


def _borders(zones: Zones) -> Iterator[tuple[int, int]]:
    """Yield ranges of zones, the zones of a pair in one of them."""
    begins = np.flatnonzero(np.diff(zones.a, prepend=-1) | np.diff(zones.b, prepend=-1))
    shares = np.array_split(begins, max(min(len(begins) // _PART, _MOST_PARTS), 1))
    return pairwise([*(int(share[0]) for share in shares if len(share)), len(zones.a)])


def _task(zones: Zones, half: Array, begin: int, end: int) -> tuple[Pairing, ZoneChords]:
    """Return the zones from one to another, and their chords."""
    a, b, first = zones.a[begin:end], zones.b[begin:end], zones.first[begin : end + 1]
    pairing = Pairing(a, b, zones.extent[begin:end], half[a] + half[b])
    return pairing, ZoneChords(first - first[0], zones.pairs[first[0] : first[-1]])


def _steps(
    legs: Legs, first: Indices, lines: Polyline, zones: Pairing, chords: ZoneChords, scale: int
) -> Steps:
    """Return the staircases of some zones; an executor's process can call this function."""
    found = staircases(
        legs, first, lines, zones, chords, scale * _CELL, scale * _TOLERANCE, STANDOFF
    )
    return found._replace(knots=found.knots.astype(np.int32))


def _in_order(parts: Sequence[Steps], tau_ms: int) -> Staircases:
    """Return the staircases of all parts in the order in which they are kept."""
    ahead = np.concatenate([np.zeros(0, np.int64), *(part.ahead for part in parts)])
    behind = np.concatenate([np.zeros(0, np.int64), *(part.behind for part in parts)])
    sizes = np.concatenate([np.zeros(0, np.int64), *(np.diff(part.first) for part in parts)])
    order = np.lexsort((ahead, behind))
    first = np.append(0, np.cumsum(sizes[order]))
    place = np.empty(len(order), np.int64)
    place[order] = first[:-1]
    at, need = np.empty((2, first[-1]), np.int32)
    done = 0
    for part in parts:
        count = len(part.ahead)
        moved = np.repeat(place[done : done + count] - part.first[:-1], np.diff(part.first))
        rows = np.arange(len(part.knots)) + moved
        at[rows], need[rows] = part.knots[:, AT], part.knots[:, NEED]
        done += count
    return Staircases(tau_ms, ahead[order], behind[order], first, at, need)


@kept
def _chords_of(curve: Nurbs) -> Chords:
    return chords_of(curve, _CHORD_ERROR)


@kept
def _line_of(curve: Nurbs) -> shapely.LineString:
    return shapely.linestrings(_chords_of(curve).points)


def _legs_of(driven: Sequence[Driven], since: Sequence[float] | None) -> Legs:
    legs = np.concatenate([one.legs for one in driven], axis=1)
    columns = dict(zip(("t0", "t1", "s0", "s1", "v0", "v1"), legs, strict=True))
    begins = [0.001 * one.plan.begin_ms for one in driven] if since is None else since
    return Legs(
        np.cumsum([0, *(one.legs.shape[1] for one in driven)]), since=np.array(begins), **columns
    )
