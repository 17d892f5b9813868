"""Between the plan document and the bytes that robots get.

Decides: how a RobotPlan becomes a Plan message and how a Plan message reads back.  The proof takes
what `unpack` returns, so it holds for the bytes.  Must not know: how plans are found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import msgspec
import numpy as np

from coordinator.errors import InputError
from coordinator.nurbs import Nurbs, nurbs
from coordinator.plan import Path, PlanDocument, RobotPlan
from protocol.codec import decode, encode, seal
from protocol.curve import Curve
from protocol.messages import Plan
from protocol.packing import pack_floats, pack_points, pack_profile, pack_stops
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline
from protocol.timing import SECOND

_WEIGHT_RATIO: Final = 100.0
_ARC_ERROR: Final = 2.5e-4
"""How far [m] the two sides may differ on where an arc length lies."""


@dataclass(frozen=True)
class Driven:
    """What a robot makes of the bytes it gets: curve, motion and the message itself."""

    id: str
    radius: float
    curve: Nurbs
    timeline: Timeline
    plan: Plan


def pack(document: PlanDocument, robot: RobotPlan, boot: int = 0) -> bytes:
    """Return the Plan message of one robot; OversizeError when it is too long to send."""
    limits = robot.limits
    accel = limits.max_accel if limits is not None else None
    stops = [(stop.s, round(stop.depart * SECOND)) for stop in robot.stops]
    if robot.start_time > 0.0:
        stops.insert(0, (0.0, round(robot.start_time * SECOND)))
    rests = {stop.s for stop in robot.stops} if accel is not None else set()
    speeds, profile = pack_profile([(s, v) for s, v in robot.profile if s not in rests])
    path = robot.path
    plan = Plan(
        epoch=document.epoch,
        boot=boot,
        robot=robot.id,
        tau_ns=round(document.tau * SECOND),
        track_mm=max(1, min(math.floor(500.0 * document.margin), 65_535)),
        brake_mmps2=0 if accel is None else max(1, min(math.floor(1000.0 * accel), 2**32 - 1)),
        degree=path.degree,
        points=pack_points(path.control_points),
        knots=pack_floats(path.knots[path.degree + 1 : len(path.knots) - path.degree]),
        weights=pack_floats([] if all(w == 1.0 for w in path.weights) else path.weights),
        speeds=speeds,
        profile=profile,
        stops=pack_stops(stops),
        checksum=0,
    )
    return encode(seal(plan))


def unpack(payload: bytes, radius: float) -> Driven:
    """Read a Plan message as the robot does; ValueError when a robot would not accept it."""
    plan = decode("plan", payload)
    if not isinstance(plan, Plan):
        raise ValueError("the message is not an acceptable plan")
    parts = unpack_plan(plan)
    scalar, timeline = Curve(*parts.path), Timeline(*parts.motion)
    if abs(timeline.length - scalar.length) > 1e-4 + 1e-6 * scalar.length:
        raise ValueError(
            f"the speed profile ends at {timeline.length} m, the curve at {scalar.length} m"
        )
    degree, knots, xs, ys, weights = parts.path
    curve = nurbs(degree, knots, np.column_stack((xs, ys)), weights)
    _check_arc_length(scalar, curve)
    return Driven(plan.robot, radius, curve, timeline, plan)


def _check_arc_length(robot: Curve, curve: Nurbs) -> None:
    """Raise ValueError when the tables of arc length are not good enough to rely on.

    Wild weights or knots hide most of a curve between the quadrature's nodes.  The tables of both
    sides, their quadratures (5 and 8 nodes) and the lengths of chords have to agree.
    """
    if curve.weights.max() > _WEIGHT_RATIO * curve.weights.min():
        raise ValueError(f"weights differ by more than {_WEIGHT_RATIO} times")
    s = np.linspace(0.0, curve.length, 200)
    u = curve.parameter_at(s)
    theirs = curve.evaluate([robot.parameter_at(place) for place in s.tolist()])
    apart = np.hypot(*(curve.evaluate(u) - theirs).T)
    fine = np.concatenate([np.linspace(a, b, 200) for a, b in pairwise(np.unique(curve.knots))])
    chords = np.hypot(*np.diff(curve.evaluate(fine), axis=0).T).sum()
    worst = max(float(apart.max()), float(np.abs(curve.arc_at(u) - s).max()))
    if worst > _ARC_ERROR or abs(chords - curve.length) > _ARC_ERROR + 1e-4 * curve.length:
        raise ValueError(f"arc length along the curve is uncertain by {worst:.4f} m or more")


def drive(document: PlanDocument) -> list[Driven]:
    """Return what every robot of a document makes of its bytes; InputError naming the robot."""
    driven, problems = [], []
    for robot in document.robots:
        try:
            driven.append(unpack(pack(document, robot), robot.radius))
        except (ValueError, OverflowError, msgspec.MsgspecError, IndexError) as error:
            problems.append(f"plan: robots[{robot.id}]: {error}")
    if problems:
        raise InputError(problems)
    return driven


def path_of(curve: Nurbs) -> Path:
    """Return a curve as the document has it."""
    return Path(
        degree=curve.degree,
        knots=curve.knots.tolist(),
        control_points=[(x, y) for x, y in curve.points.tolist()],
        weights=curve.weights.tolist(),
    )


def float32(values: Sequence[float]) -> list[float]:
    """Round numbers to the nearest float32."""
    return [float(value) for value in np.asarray(values, dtype=np.float32)]


def float32_below(value: float) -> float:
    """Return the largest float32 that is not above a value."""
    near = np.float32(value)
    return float(near if float(near) <= value else np.nextafter(near, np.float32(-np.inf)))
