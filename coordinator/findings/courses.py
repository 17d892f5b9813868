"""Computes where a log's robots were over time, from their plans and their black boxes.

Decides: which plan a robot followed at which time, how far from it the robot truly was, and who
came nearest to whom.  Must not know: files, how numbers are shown.  Times are seconds since the
log's zero, see info.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from coordinator.findings.braking import Said
from coordinator.findings.info_fields import NearestSummary, RobotSummary
from coordinator.findings.nearness import nearest_of_all
from coordinator.findings.ride_samples import Array, RideSamples, ride_of_message, times_between
from coordinator.findings.true_course import TrueCourse
from protocol import phases
from protocol.messages import Command, Message, Plan, Report
from protocol.timing import SECOND

if TYPE_CHECKING:
    from coordinator.log.records import Record

_ROW: Final = 0.02
"""Greatest error [s] of the time of a black box's row; a row is written once per control tick."""

_AWAY: Final = 1e7
"""Robots that are not in the fleet are taken to be so far apart [m]."""


class _Ridden(NamedTuple):
    """A ride: since when its robot counts as on it, when it began, its epoch's time zero [s]."""

    since: float
    begin: float
    start: float
    ride: RideSamples


class Courses:
    """The robots' courses; `info` calls `hear` with every valid message of the fleet.

    `zero_ns`: the log time that counts as 0.  `lag_ns`: how far the log's clock is ahead of the
    coordinator's.  `boot`: the coordinator whose Commands count, "" for any.
    """

    def __init__(self, zero_ns: int, lag_ns: int, boot: str) -> None:
        self._zero_ns, self._lag_ns, self._boot = zero_ns, lag_ns, boot
        self._plans: dict[tuple[int, int, str], Plan] = {}
        """By epoch, revision and robot."""

        self._begun: dict[tuple[int, int, str], float] = {}
        """When robots were first heard to drive these courses [s]."""

        self._begins: dict[int, float] = {}
        self._starts: dict[int, float] = {}
        self._frozen: dict[int, int] = {}
        self._said = Said()
        self._end = 0.0

    def hear(self, message: Message, robot: str, record: Record) -> None:
        """Record what a message says about plans and times."""
        now = (record.log_ns - self._zero_ns) / 1e9
        self._end = max(self._end, now)
        if isinstance(message, Command) and self._boot in ("", str(message.boot)):
            self._begins.setdefault(message.epoch, now)
            if message.phase == phases.GO:
                start_ns = message.start_ns + self._lag_ns
                self._starts.setdefault(message.epoch, (start_ns - self._zero_ns) / 1e9)
                self._said.begin(message, self._lag_ns)
            elif message.phase == phases.FREEZE and self._starts:
                self._frozen.setdefault(max(self._starts), record.log_ns)
        elif isinstance(message, Plan):
            self._plans.setdefault((message.epoch, message.revision, robot), message)
        elif isinstance(message, Report):
            self._begun.setdefault((message.epoch, message.revision, robot), now)
            self._said.take(message, robot, record.log_ns)

    def know(self, plan: Plan, robot: str) -> None:
        """Take in a course that a robot was sent in a log before this one."""
        self._plans.setdefault((plan.epoch, plan.revision, robot), plan)

    def fill(
        self,
        robots: Mapping[str, RobotSummary],
        boxes: Mapping[str, TrueCourse],
        stays: Mapping[str, Sequence[tuple[float, float]]],
    ) -> None:
        """Fill in each robot's nearest other robot, and the fields that need a black box.

        stays: from when until when [s] robots are in the fleet; others are near nobody.  Distances
        come from the black boxes if every robot that drove has one, else from the plans.
        """
        rides = self._rides()
        for name, box in boxes.items():
            if name in robots and len(box.t):
                robots[name].true_arrival = box.arrival
                robots[name].tracking_error = self._tracking(rides.get(name, []), box)
        boxed = bool(rides) and all(name in boxes and len(boxes[name].t) for name in rides)
        times = self._times([boxes[name] for name in rides] if boxed else [])
        names = list(rides)
        tracks = [
            boxes[name].at(times) if boxed else self._by_plan(rides[name], times) for name in names
        ]
        for number, name in enumerate(names):
            if name in stays and len(times):
                is_in = np.any([(times >= a) & (times < b) for a, b in stays[name]], axis=0)
                tracks[number][~is_in] = (number + 1) * _AWAY
        for name, near in zip(names, nearest_of_all(times, tracks), strict=False):
            if near.distance > 0.5 * _AWAY:
                continue  # They were never in the fleet together.
            robots[name].nearest = NearestSummary(
                robot=names[near.other],
                distance=round(near.distance, 4),
                t=round(near.t, 3),
                source="black boxes" if boxed else "plans",
            )

    def _times(self, boxes: list[TrueCourse]) -> Array:
        """Return the sample times, from the first GO to the end; none without a GO."""
        if not self._starts:
            return np.empty(0)
        ends = (float(box.t[-1]) for box in boxes)
        return times_between(min(self._starts.values()), max([self._end, *ends]))

    def _rides(self) -> dict[str, list[_Ridden]]:
        """Return the rides of every robot, in the order of their times."""
        found: dict[str, list[_Ridden]] = {}
        for course in sorted(self._plans):
            epoch, revision, robot = course
            if epoch not in self._starts or (revision and course not in self._begun):
                continue
            try:
                ride = ride_of_message(self._plans[course])
            except ValueError:
                continue
            start = self._starts[epoch]
            since = self._begun[course] if revision else self._begins[epoch]
            ridden = _Ridden(since, since if revision else start, start, self._driven(course, ride))
            found.setdefault(robot, []).append(ridden)
        return found

    def _driven(self, course: tuple[int, int, str], ride: RideSamples) -> RideSamples:
        """Return the ride as the robot drove it: late, and to where it left its plan."""
        epoch, revision, robot = course
        start_ns = self._zero_ns + round(self._starts[epoch] * SECOND)
        words = self._said.of(epoch, robot, revision)
        return ride.driven(
            words.driving(ride.line, ride.brake_rate, start_ns, self._frozen.get(epoch))
        )

    def _by_plan(self, rides: list[_Ridden], times: Array) -> Array:
        """Return a robot's places by its plans, (n, 2).

        The robot is at rest before, between and after its plans.
        """
        places = np.empty((len(times), 2))
        begins = [one.begin for one in rides]
        which = np.maximum(np.searchsorted(begins, times, side="right") - 1, 0)
        for number, one in enumerate(rides):
            mine = which == number
            places[mine] = one.ride.places_at(one.ride.driven_at(times[mine] - one.start))
        return places

    def _tracking(self, rides: list[_Ridden], box: TrueCourse) -> float | None:
        """Return the greatest distance [m] from the plans while they applied; None without any."""
        worst: list[float] = []
        turns = [*self._begins.values(), *(one.since for one in rides)]
        for one in rides:
            end = min((at for at in turns if at > one.since), default=math.inf)
            rows = box.between(one.since, end)
            if len(rows.t):
                worst.append(rows.off(one.ride, one.start, _ROW))
        return round(max(worst), 6) if worst else None
