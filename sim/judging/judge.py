"""Ground truth after a run: what robots touched, which arrived, how well they followed the plan.

Between two rows of a black box a robot is assumed to move straight; least distances are exact for
that motion, not sampled.
Decides: what counts as a collision (centres nearer than r_i + r_j, a centre nearer than r_i to
something solid) and as tracking error.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Final, NamedTuple

import msgspec
import numpy as np

from coordinator.curves.nurbs import Array
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import Driven, drive, unpack
from protocol.phases import DONE, FROZEN, IDLE, MOVING, PHASE_NAMES
from sim.judging.blackbox import BlackBox
from sim.judging.clearance import SolidGround
from sim.judging.evidence import Epoch, Evidence, FurtherCourse, Stay, gather
from sim.judging.polyline import Polyline

NO_COURSES: Final[Mapping[str, Sequence[FurtherCourse]]] = {}
NO_STAYS: Final[Mapping[str, Sequence[Stay]]] = {}
NO_BOX: Final = "no black box: how it drove is not known"
_GRID: Final = 0.001
_SLACK: Final = 0.02
"""Time [s] by which a black box row may be early or late: one is written per control tick."""

_HEARD: Final = 2.0
"""A robot is heard to drive a course this long [s] after it began it, or before by its clock."""

_AT_REST: Final = tuple(PHASE_NAMES[phase] for phase in (FROZEN, IDLE))


class PairVerdict(msgspec.Struct, frozen=True):
    """The least true centre distance of two robots [m] and when [s]."""

    a: str
    b: str
    separation: float
    t: float


class RobotVerdict(msgspec.Struct, frozen=True):
    """How one robot ended: arrival time [s], greatest tracking error [m] and greatest lateness [s].

    clock_error [s]: the greatest error of the robot's own estimate of the time; None when it is not
    known, because the times in the black box are that estimate or those of an unknown clock.
    least_clearance [m]: least distance between its disc and anything solid, negative where they
    overlapped; None when the floor is not known.  nearest_solid: when that was [s], and where the
    robot was then [m, m].  joined, left: when it joined the fleet last, and left it for good [s];
    it is judged from then, until then.
    """

    id: str
    arrived: bool
    t: float | None
    tracking_error: float
    lateness: float
    fault: str
    clock_error: float | None = None
    least_clearance: float | None = None
    nearest_solid: tuple[float, float, float] | None = None
    joined: float | None = None
    left: float | None = None


class Verdict(msgspec.Struct, frozen=True):
    """The result of the judge, as printed with --json.

    collisions: pairs of robots that touched; collisions_with_obstacles: robots that touched an
    obstacle or the edge of the floor, None when the floor is not known.
    """

    collisions: int
    least_separation: float | None
    pairs: list[PairVerdict]
    robots: list[RobotVerdict]
    collisions_with_obstacles: int | None = None
    least_clearance: float | None = None

    def is_good(self) -> bool:
        """Return whether no robot touched anything, and all arrived that have not left."""
        touched = self.collisions or self.collisions_with_obstacles
        there = all(robot.arrived or robot.left is not None for robot in self.robots)
        return not touched and there and not any(robot.fault == NO_BOX for robot in self.robots)


def judge(source: Path) -> Verdict:
    """Judge a run's folder or log; InputError when its plan or a black box is missing.

    When there is a log, which states when each epoch began, the robots are also compared with the
    plans of later epochs.
    """
    return judge_evidence(gather(source))


def judge_evidence(found: Evidence) -> Verdict:
    """Judge the evidence of a run."""
    return judge_boxes(found.document, found.boxes, found.later, found.courses, found.stays)


def judge_boxes(
    document: PlanDocument,
    boxes: Mapping[str, BlackBox],
    later: Sequence[Epoch] = (),
    courses: Mapping[str, Sequence[FurtherCourse]] = NO_COURSES,
    stays: Mapping[str, Sequence[Stay]] = NO_STAYS,
) -> Verdict:
    """Judge black boxes against a plan, the plans of later epochs, and further courses.

    `stays`: when robots were in the fleet that joined or left.  A robot with an empty black box is
    assumed to stand at its start.  A robot that joined and has no black box has not arrived.
    """
    epochs = [Epoch(document, -math.inf, 0.0), *later]
    rides = [{one.id: one for one in drive(epoch.document)} for epoch in epochs]
    present = {robot.id: [Stay(robot.radius)] for robot in document.robots} | dict(stays)
    parts: dict[str, list[_Part]] = {}
    for name, times in present.items():
        legs = _legs(epochs, rides, courses.get(name, ()), name, times[0].radius, boxes.get(name))
        if name in boxes and legs:
            box = _from_start(legs[0].driven, boxes[name])
            parts[name] = [_Part(one, box.during(one.since, one.until), legs) for one in times]
    pairs, collisions = [], 0
    for a, b in combinations(parts, 2):
        nearest = _nearest(parts[a], parts[b])
        if nearest is not None:
            separation, t, is_touch = nearest
            pairs.append(PairVerdict(a, b, round(separation, 6), round(t, 3)))
            collisions += is_touch
    end = max((float(part.box.t[-1]) for found in parts.values() for part in found), default=0.0)
    clearances = _clearances(document, parts)
    touching = sum(one.distance < 0.0 for one in clearances.values())
    return Verdict(
        collisions=collisions,
        least_separation=min((pair.separation for pair in pairs), default=None),
        pairs=pairs,
        robots=[
            _judge_robot(document, name, parts[name], end, clearances.get(name))
            if name in parts
            else _not_known(name, times[-1])
            for name, times in present.items()
        ],
        collisions_with_obstacles=touching if clearances else None,
        least_clearance=min((one.distance for one in clearances.values()), default=None),
    )


class _Clearance(NamedTuple):
    """The least distance of a robot's disc from anything solid [m], and when [s] and where [m]."""

    distance: float
    nearest: tuple[float, float, float]


def _not_known(name: str, stay: Stay) -> RobotVerdict:
    """Return the verdict on a robot that has no black box."""
    since, until = _known(stay.since), _known(stay.until)
    return RobotVerdict(name, False, None, 0.0, 0.0, NO_BOX, joined=since, left=until)


class _Leg(NamedTuple):
    """A course that a robot drove, from when until when; its epoch began at `start` [s]."""

    driven: Driven
    begin: float
    end: float
    start: float


class _Part(NamedTuple):
    """A robot's stay, what its black box recorded of that, and all courses that it drove."""

    stay: Stay
    box: BlackBox
    legs: Sequence[_Leg]

    def driven(self) -> list[tuple[Driven, BlackBox]]:
        """Return the courses of this stay, each with its rows in the time of its epoch."""
        since, until = self.stay.since, self.stay.until
        inside = [leg for leg in self.legs if leg.end > since and leg.begin < until]
        return [
            (leg.driven, self.box.between(leg.begin, leg.end, leg.start))
            for leg in inside or self.legs[-1:]
        ]


def _nearest(mine: Sequence[_Part], theirs: Sequence[_Part]) -> tuple[float, float, bool] | None:
    """Return how near two robots came, when, and whether they touched; None if they never met.

    Two robots meet while both are in the fleet.
    """
    found = []
    for one in mine:
        for other in theirs:
            since = max(one.stay.since, other.stay.since)
            until = min(one.stay.until, other.stay.until)
            if since < until:
                apart, t = least_separation(
                    one.box.during(since, until), other.box.during(since, until)
                )
                found.append((apart, t, apart < one.stay.radius + other.stay.radius))
    if not found:
        return None
    apart, t, _ = min(found)
    return apart, t, any(is_touch for _, _, is_touch in found)


def least_separation(a: BlackBox, b: BlackBox) -> tuple[float, float]:
    """Return the least distance [m] of two robots and when [s], exact between rows."""
    time = np.union1d(a.t, b.t)
    apart = a.at(time) - b.at(time)
    if len(time) == 1:
        return float(np.hypot(*apart[0])), float(time[0])
    step = np.diff(apart, axis=0)
    square = np.einsum("ij,ij->i", step, step)
    towards = -np.einsum("ij,ij->i", apart[:-1], step)
    part = np.clip(towards / np.where(square > 0.0, square, 1.0), 0.0, 1.0)
    nearest = apart[:-1] + part[:, None] * step
    distance = np.hypot(nearest[:, 0], nearest[:, 1])
    at = int(np.argmin(distance))
    return float(distance[at]), float(time[at] + part[at] * (time[at + 1] - time[at]))


def _clearances(
    document: PlanDocument, parts: Mapping[str, Sequence[_Part]]
) -> dict[str, _Clearance]:
    """Return each robot's least distance from anything solid; empty without a floor."""
    floor = document.workspace
    if floor is None:
        return {}
    solid = SolidGround(floor.boundary, floor.obstacles)
    return {
        name: min(_clearance(solid, one.box, one.stay.radius) for one in found)
        for name, found in parts.items()
    }


def _clearance(solid: SolidGround, box: BlackBox, radius: float) -> _Clearance:
    apart, t = solid.nearest(box)
    x, y = box.at(np.array([t]))[0].tolist()
    return _Clearance(round(apart - radius, 6) + 0.0, (round(t, 3), round(x, 3), round(y, 3)))


def _from_start(driven: Driven, box: BlackBox) -> BlackBox:
    """Return the box; if it has no rows, one with a row at the planned start."""
    if len(box.t):
        return box
    start = driven.curve.at_arc([0.0])
    return BlackBox(np.zeros(1), start, np.zeros(1), (PHASE_NAMES[0],))


def _legs(
    epochs: Sequence[Epoch],
    rides: Sequence[Mapping[str, Driven]],
    courses: Sequence[FurtherCourse],
    name: str,
    radius: float,
    box: BlackBox | None,
) -> list[_Leg]:
    """Return the courses that a robot drove, in order; each lasts until the next one began."""
    parts = [
        (epoch.begin, epoch.start, ride.get(name))
        for epoch, ride in zip(epochs, rides, strict=True)
    ]
    if box is not None:
        parts += [
            (_begun(box, one.begin), one.start, unpack(one.payload, radius)) for one in courses
        ]
    parts.sort(key=lambda part: part[0])
    ends = [*(begin for begin, _, _ in parts[1:]), math.inf]
    return [
        _Leg(driven, begin, end, start)
        for (begin, start, driven), end in zip(parts, ends, strict=True)
        if driven is not None
    ]


def _begun(box: BlackBox, heard: float) -> float:
    """Return when a robot began a course, which it was heard to drive at a time [s].

    Its arc length falls then, because it counts from the beginning of the course.
    """
    falls = box.t[1:][np.diff(box.s) < 0.0]
    near = falls[np.abs(falls - heard) <= _HEARD]
    return float(near[np.abs(near - heard).argmin()]) if len(near) else heard


def _judge_robot(
    document: PlanDocument,
    name: str,
    parts: Sequence[_Part],
    end: float,
    clearance: _Clearance | None,
) -> RobotVerdict:
    """Judge one robot: each leg against its plan, and whether it arrived in its last stay.

    A robot that froze within the tolerance of its goal has arrived: no plan takes it any farther,
    and it is idle there during later epochs, in which it has no part.
    """
    every = [leg for part in parts for leg in part.driven()]
    (stay, whole, _), legs = parts[-1], parts[-1].driven()
    clock_errors = [error for part in parts if (error := part.box.clock_error()) is not None]
    tolerance, driven, box = 0.5 * document.margin, legs[-1][0], whole
    goal = driven.curve.at_arc([driven.curve.length])[0]
    near = np.hypot(*(box.places - goal).T) <= tolerance
    rows = len(legs[-1][1].t)
    since = box.t[-rows] if driven.plan.revision and rows else -math.inf
    done = [
        t
        for t, phase in zip(box.t, box.phases, strict=True)
        if phase == PHASE_NAMES[DONE] and t >= since
    ]
    there = int(np.argmax(np.logical_and.accumulate(near[::-1])[::-1]))
    rests = near[-1] and box.phases[-1] in _AT_REST and _AT_REST[0] in box.phases[there:]
    if not done and rests:
        done = box.t[there:].tolist()
    fault = ""
    if not done:
        ended = float(box.t[-1])
        silent = box.phases[-1] == PHASE_NAMES[MOVING] and ended < min(end, stay.until) - 0.5
        fault = f"recording ends at {ended:.2f} s" if silent else f"ended {box.phases[-1]}"
    return RobotVerdict(
        id=name,
        arrived=bool(done) and bool(near[-1]),
        t=round(float(done[0]), 3) if done else None,
        tracking_error=round(max(tracking_error(d, part) for d, part in every), 6),
        lateness=round(max(_lateness(d, part) for d, part in every), 3),
        fault=fault,
        clock_error=round(max(clock_errors), 6) if clock_errors else None,
        least_clearance=None if clearance is None else clearance.distance,
        nearest_solid=None if clearance is None else clearance.nearest,
        joined=_known(stay.since),
        left=_known(stay.until),
    )


def _known(time: float) -> float | None:
    return round(time, 3) if math.isfinite(time) else None


def tracking_error(driven: Driven, box: BlackBox) -> float:
    """Return the greatest distance [m] from all places where the plan has had the robot so far."""
    count = 2 + int(driven.curve.length / _GRID)
    arcs = np.linspace(0.0, driven.curve.length, count)
    line = Polyline(driven.curve.at_arc(arcs))
    now = np.array([driven.timeline.s_at(t + _SLACK) for t in box.t])
    until = np.minimum(np.searchsorted(arcs, now, side="left") + 1, count - 1)
    return float(line.distances(box.places, until).max(initial=0.0))


def _lateness(driven: Driven, box: BlackBox) -> float:
    """Return the greatest delay [s] of the robot behind its plan while it was under way.

    Once it is at the end, what it does later belongs to its next course.
    """
    legs = driven.timeline
    knots_t = np.column_stack((legs.t0, legs.t1)).ravel()
    knots_s = np.column_stack((legs.s0, legs.s1)).ravel()
    fine_t = np.linspace(0.0, legs.finish, 2 + int(legs.finish / 0.01))
    fine_t = np.union1d(fine_t, knots_t)
    fine_s = np.maximum.accumulate([legs.s_at(t) for t in fine_t])
    is_at_end = box.s + 1e-4 >= driven.curve.length
    comes_there = is_at_end & np.append(False, ~is_at_end[:-1])
    phases = np.array(box.phases)
    was_done = np.logical_or.accumulate(phases == PHASE_NAMES[DONE])
    counts = (phases == PHASE_NAMES[MOVING]) & ~was_done & (~is_at_end | comes_there)
    if not counts.any() or len(knots_s) == 0:
        return 0.0
    reached = np.minimum(box.s[counts] + 1e-4, driven.curve.length)
    due = np.interp(reached, *_latest(fine_s, fine_t))
    return float(max(0.0, np.max(box.t[counts] - due)))


def _latest(s: Array, t: Array) -> tuple[Array, Array]:
    """Return strictly increasing s with the last time at each, since a wait is not a delay."""
    last = np.append(np.diff(s) > 1e-9, True)
    return s[last], t[last]
