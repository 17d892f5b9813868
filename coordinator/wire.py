"""Between the plan document and the bytes that robots get.

Decides: how a RobotPlan becomes a Plan message and how a Plan message reads back.  The proof takes
what `unpack` returns, so it holds for the bytes.  Must not know: how plans are found.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import msgspec
import numpy as np

from coordinator.budget import share_for_lateness
from coordinator.errors import InputError
from coordinator.nurbs import Nurbs, nurbs
from coordinator.plan import Path, PlanDocument, RobotPlan
from protocol.codec import (
    decode,
    encode,
    pack_floats,
    pack_stops,
    seal,
    unpack_floats,
    unpack_stops,
)
from protocol.curve import Curve, clamped_knots
from protocol.messages import Plan
from protocol.timeline import Timeline
from protocol.timing import LEASE, SECOND


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
    path = robot.path
    plan = Plan(
        epoch=document.epoch,
        boot=boot,
        robot=robot.id,
        tau_ns=round(document.tau * SECOND),
        late_ns=round(share_for_lateness(document.tau) * SECOND),
        lease_ns=LEASE,
        track_mm=max(1, math.floor(500.0 * document.margin)),
        brake_mmps2=0 if accel is None else max(1, min(math.floor(1000.0 * accel), 2**32 - 1)),
        degree=path.degree,
        points=pack_floats([value for point in path.control_points for value in point]),
        knots=pack_floats(path.knots[path.degree + 1 : len(path.knots) - path.degree]),
        weights=pack_floats([] if all(w == 1.0 for w in path.weights) else path.weights),
        profile=pack_floats([value for knot in robot.profile for value in knot]),
        stops=pack_stops(stops),
        checksum=0,
    )
    return encode(seal(plan))


def unpack(payload: bytes, radius: float) -> Driven:
    """Read a Plan message as the robot does; ValueError when a robot would not accept it."""
    plan = decode("plan", payload)
    if not isinstance(plan, Plan):
        raise ValueError("the message is not an acceptable plan")
    points = np.array(unpack_floats(plan.points)).reshape(-1, 2)
    knots = clamped_knots(plan.degree, unpack_floats(plan.knots) or [0.0])
    weights = unpack_floats(plan.weights) or [1.0] * len(points)
    scalar = Curve(plan.degree, knots, points[:, 0].tolist(), points[:, 1].tolist(), weights)
    profile = unpack_floats(plan.profile)
    stops = unpack_stops(plan.stops)
    timeline = Timeline(
        profile[::2],
        profile[1::2],
        [s for s, _ in stops],
        [depart_ns / SECOND for _, depart_ns in stops],
    )
    if abs(timeline.length - scalar.length) > 1e-4 + 1e-6 * scalar.length:
        raise ValueError(
            f"the speed profile ends at {timeline.length} m, the curve at {scalar.length} m"
        )
    return Driven(plan.robot, radius, nurbs(plan.degree, knots, points, weights), timeline, plan)


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
    return float(near if near <= value else np.nextafter(near, np.float32(-np.inf)))
