"""The courses that a robot under examination is sent, as messages and as places.

A course goes around a circle: the robot needs a floor little larger than that, wherever it stops.

Decides: their shape and speed.  Must not know: when they are sent.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Final, NamedTuple

from protocol.curve import Curve
from protocol.messages import Plan, Rest
from protocol.plan_bytes import pack_floats, pack_points, pack_profile
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline

TRACK_MM: Final = 20
CLOCK_MS: Final = 20
_DEGREE: Final = 3
_STEPS: Final = 24
"""Legs of the control polygon for one turn around the circle."""

_BRAKE_SHARE: Final = 0.8
"""Plans brake with this share of what a robot can."""

Pose = tuple[float, float, float]


class Pace(NamedTuple):
    """How a robot is to drive: speed [m/s], acceleration [m/s^2] and radius of the circle [m]."""

    speed: float = 0.4
    accel: float = 0.5
    radius: float = 0.5


@dataclass(frozen=True, eq=False)
class Course:
    """A Plan and what follows from it: the curve, and the motion on it."""

    plan: Plan
    curve: Curve
    motion: Timeline

    @property
    def begin_ms(self) -> int:
        """Return the plan time [ms] at which it begins."""
        return self.plan.begin_ms

    @property
    def finish_ms(self) -> int:
        """Return the plan time [ms] at which a robot on time is at the goal."""
        return math.ceil(1000.0 * self.motion.finish)

    def s_at(self, time_ms: float) -> float:
        """Return the arc length [m] at a plan time [ms]."""
        return self.motion.s_at(time_ms / 1000.0)

    def pose_at(self, s: float) -> Pose:
        """Return the pose [m, m, rad] on the path at an arc length [m]."""
        self.curve.place(s)
        return self.curve.x, self.curve.y, math.atan2(self.curve.dy, self.curve.dx)

    def resting_pose(self, rest: Rest) -> Pose:
        """Return the pose of a robot that reports where on this course it rests."""
        x, y, heading = self.pose_at(rest.s_m)
        along, left = rest.beyond_mm / 1000.0, rest.off_mm / 1000.0
        x += along * math.cos(heading) - left * math.sin(heading)
        y += along * math.sin(heading) + left * math.cos(heading)
        return x, y, heading + rest.turn_mrad / 1000.0


def course_from(pose: Pose, length: float, pace: Pace, **fields: int | str) -> Course:
    """Return a course of about a length [m] that begins at rest at a pose.

    `fields`: epoch, boot, robot, number, revision and begin_ms of its Plan.
    """
    points = _circle(pose, length, pace.radius)
    spans = len(points) - _DEGREE
    knots = [float(knot) for knot in range(1, spans + 1)]
    curve = _curve(points, knots)
    accel = _BRAKE_SHARE * pace.accel
    end = _float32(curve.length)
    ramp = min(pace.speed**2 / (2.0 * accel), 0.4 * end)
    top = math.sqrt(2.0 * accel * ramp)
    speeds, profile = pack_profile([(0.0, 0.0), (ramp, top), (end - ramp, top), (end, 0.0)])
    plan = Plan(
        tau_ns=10**9,
        track_mm=TRACK_MM,
        brake_mmps2=math.floor(1000.0 * pace.accel),
        clock_ms=CLOCK_MS,
        degree=_DEGREE,
        points=pack_points(points),
        knots=pack_floats(knots),
        weights=b"",
        speeds=speeds,
        profile=profile,
        stops=b"",
        **fields,  # type: ignore[arg-type]
    )
    parts = unpack_plan(plan)
    return Course(plan, Curve(*parts.path), Timeline(*parts.motion))


def _circle(pose: Pose, length: float, radius: float) -> list[tuple[float, float]]:
    """Return control points of a path to the left; its first leg has the pose's heading."""
    x, y, heading = pose
    step = math.tau * radius / _STEPS
    points = [(_float32(x), _float32(y))]
    for _ in range(max(round(length / step), _DEGREE)):
        x, y = x + step * math.cos(heading), y + step * math.sin(heading)
        points.append((_float32(x), _float32(y)))
        heading += math.tau / _STEPS
    return points


def _curve(points: list[tuple[float, float]], knots: list[float]) -> Curve:
    ends = [0.0] * (_DEGREE + 1), [knots[-1]] * (_DEGREE + 1)
    xs, ys = [x for x, _ in points], [y for _, y in points]
    return Curve(_DEGREE, ends[0] + knots[:-1] + ends[1], xs, ys, [1.0] * len(points))


def _float32(value: float) -> float:
    (near,) = struct.unpack("<f", struct.pack("<f", value))
    return float(near)
