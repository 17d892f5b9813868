"""Conversion between the plan document and the bytes that robots receive.

A plan's messages are packed once.  The proof reads these very bytes (`unpack`).  A coordinator that
sends them replaces the boot id, and with it the checksum, and nothing else (`address`).

Decides: how a RobotPlan becomes a Plan message and how a Plan message reads back.  Must not know:
how plans are found.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, TypeVar

import msgspec
import numpy as np

from coordinator.base.errors import PartsError
from coordinator.curves.bounds import Chain, flatten
from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.curves.nurbs_kernels import ArcTable, parameters_at, series
from coordinator.plan.arc_length_kernels import robot_table
from coordinator.plan.document import Path, PlanDocument, RobotPlan
from coordinator.plan.staircases import Staircases
from coordinator.scenario.link_times import link_times
from coordinator.scenario.margin import ARC_ERROR, track_mm_for
from protocol.codec import decode, encode
from protocol.curve import Curve, cells_per_span
from protocol.messages import Plan
from protocol.plan_bytes import pack_floats, pack_points, pack_profile, pack_stops
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline
from protocol.timing import MILLISECOND, SECOND

T = TypeVar("T")

_WEIGHT_RATIO: Final = 100.0
_PLACES: Final = 200
"""Least number of places at which a curve's arc lengths are compared."""

_ARC_SHARE: Final = 1e-4
"""Error of the length that is allowed beyond ARC_ERROR, as a share of the length."""

FLAT: Final = 2e-4
"""Greatest deviation [m] of a curve from the polyline that approximates it."""

_FINER: Final = 5
"""How often a curve is flattened again, each time four times as finely, to bound its length."""


@dataclass(frozen=True, eq=False)
class Driven:
    """A robot's decoded Plan message: the curve and motion that follow from it, and the message.

    chain: the curve as a polyline with a proven deviation of at most FLAT.
    arc_error [m]: the error of the curve's table of arc lengths, measured in the middle of cells,
    where a cubic piece per cell is worst, and at other places inside of them.
    """

    id: str
    radius: float
    curve: Nurbs
    timeline: Timeline
    plan: Plan
    chain: Chain
    arc_error: float

    @cached_property
    def legs(self) -> Array:
        """The legs of the motion, (6, n): begin, end [s], s [m] and v [m/s] at both."""
        line = self.timeline
        return np.array([line.t0, line.t1, line.s0, line.s1, line.v0, line.v1])

    @cached_property
    def rests(self) -> list[tuple[float, float, float]]:
        """Where the robot rests on its way: s [m], and when it comes there and goes on [s]."""
        _, _, stop_s, departs, _ = unpack_plan(self.plan).motion
        return list(zip(stop_s, self.timeline.arrivals, departs, strict=True))


@dataclass(frozen=True)
class PackedPlan:
    """A plan document and its Plan messages by robot id, as packed: with boot id 0.

    `staircases`: who has to wait for whom if robots are late; None where nobody asked for them.
    """

    document: PlanDocument
    messages: Mapping[str, bytes]
    staircases: Staircases | None = None

    @cached_property
    def driven(self) -> list[Driven]:
        """The decoded messages; raises PartsError naming the robots that would refuse theirs."""
        robots, messages = self.document.robots, self.messages
        return [one for _, one in _each(robots, lambda one: unpack(messages[one.id], one.radius))]

    def bounded_by(self, staircases: Staircases) -> PackedPlan:
        """Return the plan with these staircases, without decoding its messages again."""
        plan = replace(self, staircases=staircases)
        vars(plan)["driven"] = self.driven
        return plan


def pack(
    document: PlanDocument, robot: RobotPlan, number: int, revision: int = 0, begin_ms: int = 0
) -> bytes:
    """Return the Plan message of the robot with this number, with boot id 0.

    `revision`, `begin_ms`: which of the robot's courses it is, and the plan time at which the
    course begins.  Raises OversizeError when it is too long.
    """
    limits = robot.limits
    accel = limits.max_accel if limits is not None else None
    stops = [(stop.s, round(stop.depart * SECOND)) for stop in robot.stops]
    if robot.start_time > 0.0:
        stops.insert(0, (0.0, round(robot.start_time * SECOND)))
    rests = {stop.s for stop in robot.stops} if accel is not None else set()
    speeds, profile = pack_profile([(s, v) for s, v in robot.profile if s not in rests])
    path, times = robot.path, link_times(document.link)
    plan = Plan(
        epoch=document.epoch,
        boot=0,
        robot=robot.id,
        number=number,
        revision=revision,
        begin_ms=begin_ms,
        tau_ns=round(document.tau * SECOND),
        track_mm=min(track_mm_for(document.margin), 65_535),
        brake_mmps2=0 if accel is None else max(1, min(math.floor(1000.0 * accel), 2**32 - 1)),
        clock_ms=times.clock_error_ns // MILLISECOND,
        degree=path.degree,
        points=pack_points(path.control_points),
        knots=pack_floats(path.knots[path.degree + 1 : len(path.knots) - path.degree]),
        weights=pack_floats([] if all(w == 1.0 for w in path.weights) else path.weights),
        speeds=speeds,
        profile=profile,
        stops=pack_stops(stops),
    )
    return encode(plan)


def packed(document: PlanDocument) -> PackedPlan:
    """Return a document with its messages.

    Raises PartsError naming the robots for which no message can be made.
    """
    numbers = {robot.id: number for number, robot in enumerate(document.robots)}
    made = _each(document.robots, lambda one: pack(document, one, numbers[one.id]))
    return PackedPlan(document, dict(made))


def address(message: bytes, boot: int) -> bytes:
    """Return a packed Plan message as the coordinator with this boot id sends it."""
    plan = decode("plan", message)
    assert isinstance(plan, Plan)
    return encode(msgspec.structs.replace(plan, boot=boot))


def unpack(payload: bytes, radius: float) -> Driven:
    """Read a Plan message as the robot does; raises ValueError when a robot would not accept it."""
    plan = decode("plan", payload)
    if not isinstance(plan, Plan):
        raise ValueError("the message is not an acceptable plan")
    parts = unpack_plan(plan)
    degree, knots, xs, ys, weights = parts.path
    curve = nurbs(degree, knots, np.column_stack((xs, ys)), weights)
    robot, timeline = _RobotCurve(curve), Timeline(*parts.motion)
    if abs(timeline.length - robot.length) > 1e-4 + 1e-6 * robot.length:
        raise ValueError(
            f"the speed profile ends at {timeline.length:.4f} m, the curve at {robot.length:.4f} m"
        )
    chain = flatten(curve, FLAT)
    error = _arc_error(robot.table, curve, chain)
    return Driven(plan.robot, radius, curve, timeline, plan, chain, error)


class _RobotCurve(Curve):
    """The robot's own curve with its checks, except that a kernel computes the arc-length table."""

    def __init__(self, curve: Nurbs) -> None:
        self._same = curve
        xs, ys = curve.points.T.tolist()
        super().__init__(curve.degree, curve.knots.tolist(), xs, ys, curve.weights.tolist())

    def _measure(self) -> None:
        self.table = measured(self._same)
        self._cell_s = self.table.s.tolist()


def measured(curve: Nurbs) -> ArcTable:
    """Return the robot's table of arc lengths."""
    borders, powers = series(*curve.lifted)
    return robot_table(borders, powers, cells_per_span(len(powers)))


def _arc_error(table: ArcTable, curve: Nurbs, chain: Chain) -> float:
    """Return the error [m] of the curve's table of arc lengths, measured inside of its cells.

    Raises ValueError when the table is not good enough to rely on: extreme weights or knots can
    hide most of a curve between the quadrature's nodes.  The robot's table and ours, made with
    quadratures of 5 and 8 nodes, have to agree, and the length has to agree with its proven bounds.
    """
    if curve.weights.max() > _WEIGHT_RATIO * curve.weights.min():
        raise ValueError(f"weights differ by more than {_WEIGHT_RATIO} times")
    parts = max(2, math.ceil(_PLACES / len(table.s)))
    inner = np.arange(1, parts) / parts
    s = (table.s[:-1, None] + np.diff(table.s)[:, None] * inner).ravel()
    u = curve.parameter_at(s)
    places = curve.evaluate(u)
    apart = np.hypot(*(places - curve.evaluate(parameters_at(*table, s))).T)
    errors = np.abs(curve.arc_at(u) - s)
    both = np.maximum(apart, errors)
    if not both.max() <= ARC_ERROR:
        raise _uncertain(float(both.max()), places[int(both.argmax())])
    _check_length(curve, chain)
    return float(errors.max())


def _check_length(curve: Nurbs, chain: Chain) -> None:
    """Raise ValueError unless the length is certain to be right to 0.25 mm and 0.1 mm per metre.

    The true length lies between that of the chords and that of the control polygons.  Both differ
    from it by an amount that grows with the curve's turning, so the curve is flattened more finely
    until they decide.
    """
    allowed = ARC_ERROR + _ARC_SHARE * curve.length
    for finer in range(_FINER + 1):
        chain = flatten(curve, FLAT / 4.0**finer) if finer else chain
        least, most = chain.lengths
        unsure = max(most - curve.length, curve.length - least)
        if unsure <= allowed:
            return
        if most - least < 0.1 * allowed:
            break
    measured = np.diff(curve.arc_at(chain.u))
    chords = np.hypot(*np.diff(chain.points, axis=0).T)
    worst = int(np.abs(measured - chords).argmax())
    raise _uncertain(unsure, chain.points[worst])


def _uncertain(size: float, place: Array) -> ValueError:
    """Return the ValueError for arc lengths that may be wrong by a size [m] near a place."""
    return ValueError(
        f"arc length along the curve is uncertain by {1e3 * size:.2g} mm "
        f"near ({place[0]:.2f}, {place[1]:.2f})"
    )


def drive(document: PlanDocument) -> list[Driven]:
    """Return the decoded messages of all robots of a document.

    Raises PartsError naming robots without a message, or those that would refuse theirs.
    """
    return packed(document).driven


def _each(robots: Sequence[RobotPlan], make: Callable[[RobotPlan], T]) -> list[tuple[str, T]]:
    """Return `make` of each robot, with the robot's id.

    Raises PartsError with all robots for which `make` fails.
    """
    made, problems = [], {}
    for robot in robots:
        try:
            made.append((robot.id, make(robot)))
        except (ValueError, OverflowError, msgspec.MsgspecError, IndexError) as error:
            problems[robot.id] = f"plan: robots[{robot.id}]: {error}"
    if problems:
        raise PartsError(list(problems.values()), list(problems))
    return made


def path_of(curve: Nurbs) -> Path:
    """Return a curve as a Path of the document."""
    return Path(
        degree=curve.degree,
        knots=curve.knots.tolist(),
        control_points=[(x, y) for x, y in curve.points.tolist()],
        weights=curve.weights.tolist(),
    )


def curve_of(path: Path) -> Nurbs:
    """Return a Path of the document as a curve."""
    return nurbs(path.degree, path.knots, path.control_points, path.weights)


def float32(values: Sequence[float]) -> list[float]:
    """Round numbers to the nearest float32."""
    return [float(value) for value in np.asarray(values, dtype=np.float32)]


def float32_below(value: float) -> float:
    """Return the largest float32 that is not greater than a value."""
    near = np.float32(value)
    return float(near if float(near) <= value else np.nextafter(near, np.float32(-np.inf)))
