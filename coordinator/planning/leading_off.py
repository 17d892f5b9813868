"""How a robot leaves its course while it drives: along it for a while, then smoothly off it.

The new curve has the old one's control points as far as the robot may still drive on the old
course; those that follow lie on the way to the new goal, so the curve is C2 where it leads off.
The speed knots are the old ones up to there.

Decides: curve, limits and motion of such a course.  Must not know: the courses of others, messages,
why the robot is sent elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from coordinator.base.errors import PlanError
from coordinator.curves.chords import Chords
from coordinator.curves.knots import piece, refine
from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.motion.velocity_profile import Motion, SpeedLimits, limits_after
from coordinator.paths.spline_fit import Fit
from coordinator.plan.course import Course
from coordinator.plan.wire import Driven
from coordinator.proof.shared_course import shared_until
from coordinator.scenario.model import Pose, Robot
from coordinator.schedule.safe_intervals import Begun
from coordinator.schedule.track import Track

_SPARE: Final = 0.01
"""The curves part this far [m] behind the place where they may."""

_LEAD: Final = 0.1
"""Distance [m] between the knots behind that place."""

_APART: Final = 1e-4
"""Knots are farther apart than this [m]."""

_LEAST_SPEED: Final = 0.05
"""A slower robot [m/s] stops before it leaves its course."""

_SHARES: Final = (1.0, 0.6, 0.3)
"""Shares of its speed to which a robot may brake before it turns."""

_TURN_ROOM: Final = 1.6
"""How far [m] a turn begins before its corner, per metre of its radius."""

_LEAST_RADIUS: Final = 0.1

_DEGREE: Final = 3


@dataclass(frozen=True, eq=False)
class UnderWay:
    """A robot that drives `driven`, which its next course is to be between two plan times [ms]."""

    driven: Driven
    begin_ms: int
    leave_ms: int

    @cached_property
    def _arcs(self) -> tuple[float, float]:
        """Where [m] it is at these times."""
        line = self.driven.timeline
        return line.s_at(0.001 * self.begin_ms), line.s_at(0.001 * self.leave_ms)

    @cached_property
    def _old(self) -> tuple[Nurbs, int]:
        """The old curve from the beginning on, and how many of its control points are kept."""
        curve, name = self.driven.curve, self.driven.id
        begin, leave = self._arcs
        knots = leave + _SPARE + _LEAD * np.arange(3)
        if curve.degree != _DEGREE or not knots[-1] < curve.length - _APART:
            raise PlanError("has a course that ends before it could leave it", name)
        first, *inner = curve.parameter_at(np.append(begin, knots)).tolist()
        try:
            part = refine(piece(curve, first, float(curve.knots[-1])), np.array(inner) - first)
        except ValueError as error:
            raise PlanError(f"cannot leave its course in motion: {error}", name) from None
        return part, int(np.searchsorted(part.knots, inner[0] - first))

    def is_possible(self) -> bool:
        """Return whether the robot drives that far, fast enough to leave its course in motion."""
        try:
            return len(self.knots) > 1 and self._old[1] > 0
        except PlanError:
            return False

    def start(self, ahead: float = 0.0) -> Pose:
        """Return the pose [m, m, rad] from which the way is free, or one straight ahead of it."""
        old, kept = self._old
        (x0, y0), (x, y) = old.points[kept - 2 : kept].tolist()
        heading = math.atan2(y - y0, x - x0)
        return x + ahead * math.cos(heading), y + ahead * math.sin(heading), heading

    def leads(self, accel: float, lateral: float) -> list[tuple[float, float]]:
        """Return how far [m] straight ahead it may turn: by when it has braked, with room to turn.

        For each of some speeds: the distance in which it brakes to it, and what the turn takes.
        """
        fastest = float(self.knots[-1, 1])
        slow = [share * share * fastest for share in _SHARES]
        return [
            ((fastest - w) / (2.0 * accel), _TURN_ROOM * max(w / lateral, _LEAST_RADIUS))
            for w in slow
        ]

    def joined(self, fit: Fit, ahead: float) -> Nurbs:
        """Return the curve that leads off the course along the polygon of a fit.

        The fit begins so far [m] ahead.
        """
        old, kept = self._old
        along = np.append(0.0, ahead + fit.at) if ahead > 0.0 else fit.at
        bent = np.vstack((self.start()[:2], fit.bent)) if ahead > 0.0 else fit.bent
        settled = old.knots[: kept + _DEGREE]
        at = float(settled[-_DEGREE:].mean())
        inner = fit.curve.knots[_DEGREE + 1 : -_DEGREE - 1] + at + ahead
        end = at + float(along[-1])
        is_apart = inner > settled[-1] + _APART
        inner, has_via = inner[is_apart], bool(fit.exact[1:-1].any())
        if end <= settled[-1] + _APART or (has_via and not is_apart.all()):
            raise PlanError("is too near its goal to get there in motion", self.driven.id)
        knots = np.concatenate((settled, inner, np.full(_DEGREE + 1, end)))
        greville = (knots[1:-3] + knots[2:-2] + knots[3:-1])[kept:] / _DEGREE - at
        free = np.column_stack([np.interp(greville, along, bent[:, k]) for k in (0, 1)])
        points = np.concatenate((old.points[:kept], free))
        points[-1] = fit.vertices[-1]
        weights = np.concatenate((old.weights[:kept], np.full(len(free), old.weights[kept - 1])))
        return nurbs(
            _DEGREE,
            knots.astype(np.float32),
            points.astype(np.float32),
            weights.astype(np.float32),
        )

    def is_shared_by(self, new: Driven) -> bool:
        """Return whether a course is proven to be the old one until the robot may leave it."""
        return 1000.0 * shared_until(self.driven, new) > self.leave_ms - 1

    def track(self, curve: Nurbs, limits: SpeedLimits) -> Track:
        """Return a curve with its limits as a track that begins with a straight run-up from rest.

        So that the search for the motion need not know of motions that begin under way.
        """
        run_up, chords = self._run_up(limits), Course.chords_of(curve)
        knots = ((0.0, 0.0), *((s + run_up, w) for s, w in limits.bends))
        _, ahead = curve.derivatives([0.0], 1)
        before = chords.points[0] - run_up * ahead[0] / np.hypot(*ahead[0])
        longer = Chords(
            np.append(0.0, chords.s + run_up), np.vstack((before, chords.points)), chords.error
        )
        return Track(replace(limits, length=limits.length + run_up, bends=knots), longer)

    def begun(self, limits: SpeedLimits) -> Begun:
        """Return what is fixed of the motion on such a track."""
        (_, first), run_up = self.knots[0].tolist(), self._run_up(limits)
        release = 0.001 * self.begin_ms - 2.0 * run_up / math.sqrt(first)
        shared = run_up + float(self.knots[-1, 0])
        beyond = shared + limits.top / (2.0 * limits.ramp)
        return Begun((), 0.0, release, release, beyond, settled=shared)

    def without_run_up(self, motion: Motion, limits: SpeedLimits) -> Motion:
        """Return a motion on such a track without its run-up."""
        return motion.from_place(self._run_up(limits))

    def _run_up(self, limits: SpeedLimits) -> float:
        return float(self.knots[0, 1]) / (2.0 * limits.ramp)

    @cached_property
    def knots(self) -> Array:
        """Knots (n, 2) of the motion that both courses have: s [m] from the beginning on, v^2.

        Raises PlanError if the robot stands or is slow there.
        """
        begin, leave = self._arcs
        _, _, s0, s1, v0, v1 = self.driven.legs
        near = np.flatnonzero((s1 > begin) & (s0 < leave))
        if not len(near):
            raise PlanError("stands where it could leave its course", self.driven.id)
        s = np.append(s0[near], s1[near[-1]])
        w = np.append(v0[near], v1[near[-1]]) ** 2
        places = np.concatenate(([begin], s[(s > begin) & (s < leave)], [leave]))
        heights = np.interp(places, s, w)
        if heights.min() < _LEAST_SPEED**2:
            raise PlanError("stands where it could leave its course", self.driven.id)
        return np.column_stack((places - begin, heights))

    def limits(self, curve: Nurbs, robot: Robot, speed: float, accel: float) -> SpeedLimits:
        """Return the limits on a curve along which a robot drives as on its course at first.

        speed [m/s] and accel [m/s^2]: what is planned with.  Raises PlanError if it is too fast for
        where the curve leads, or stands on the way.
        """
        limits = limits_after(
            self.knots, curve, speed, accel, robot.max_lateral_accel, robot.max_turn_rate
        )
        if limits is None:
            raise PlanError("is too fast to leave its course in motion", self.driven.id)
        return limits
