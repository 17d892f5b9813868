"""Computes where a log's robots were over time, from their plans and their black boxes.

Decides: which plan a robot followed at which time, how far from it the robot truly was, and who
came nearest to whom.  Must not know: files, how numbers are shown.  Times are seconds since the
log's zero, see info.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from coordinator.findings.braking import Said
from coordinator.findings.info_fields import NearestSummary, RobotSummary
from coordinator.findings.nearness import nearest_of_all
from coordinator.findings.plans_from_messages import is_further
from coordinator.findings.ride_samples import Array, RideSamples, ride_of_message, times_between
from coordinator.findings.true_course import STOPPED, TrueCourse
from protocol import phases
from protocol.messages import Command, Message, Plan, Report
from protocol.timing import SECOND

if TYPE_CHECKING:
    from coordinator.log.records import Record

_ROW: Final = 0.02
"""Greatest error [s] of the time of a black box's row; a row is written once per control tick."""


class _Ridden(NamedTuple):
    """A ride: since when its robot counts as on it, when it began, its epoch's time zero [s]."""

    since: float
    begin: float
    start: float
    ride: RideSamples


class Courses:
    """The robots' courses; `info` calls `hear` with every valid message of the fleet.

    The messages of the logs that it resumes come first.  `zero_ns`: the log time that counts as 0.
    `lag_ns`: how far the log's clock is ahead of the coordinator's.  `boots`: the coordinators
    whose Commands count; with "" among them, any.
    """

    def __init__(self, zero_ns: int, lag_ns: int, boots: Set[str]) -> None:
        self._zero_ns, self._lag_ns, self._boots = zero_ns, lag_ns, boots
        self._plans: dict[tuple[int, int, str], Plan] = {}
        """By epoch, revision and robot."""

        self._begun: dict[tuple[int, int, str], float] = {}
        """When robots were first heard to drive these courses [s]."""

        self._before: dict[str, list[_Ridden]] = {}
        """By robot: its rides before it joined again, with which its revisions begin anew."""

        self._begins: dict[int, float] = {}
        self._starts: dict[int, float] = {}
        self._frozen: dict[int, int] = {}
        self._said = Said()
        self._since, self._end = math.inf, 0.0

    def hear(self, message: Message, robot: str, record: Record) -> None:
        """Record what a message says about plans and times."""
        now = (record.log_ns - self._zero_ns) / 1e9
        self._since, self._end = min(self._since, now), max(self._end, now)
        if isinstance(message, Command) and not self._boots.isdisjoint(("", str(message.boot))):
            self._begins.setdefault(message.epoch, now)
            if message.phase == phases.GO:
                start_ns = message.start_ns + self._lag_ns
                self._starts.setdefault(message.epoch, (start_ns - self._zero_ns) / 1e9)
                self._said.begin(message, self._lag_ns)
            elif message.phase == phases.FREEZE and self._starts:
                self._frozen.setdefault(max(self._starts), record.log_ns)
        elif isinstance(message, Plan):
            known = self._plans.setdefault((message.epoch, message.revision, robot), message)
            if known.number != message.number:
                self._join_again(robot)
                self._plans[message.epoch, message.revision, robot] = message
        elif isinstance(message, Report):
            self._begun.setdefault((message.epoch, message.revision, robot), now)
            self._said.take(message, robot, record.log_ns)

    def _join_again(self, robot: str) -> None:
        """Keep a robot's rides, and forget what they were made of."""
        self._before[robot] = self._rides().get(robot, [])
        for course in [one for one in self._plans if one[2] == robot]:
            self._said.forget(course[0], robot, course[1] + 1)
            del self._plans[course]
            self._begun.pop(course, None)

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
        rides, end = self._rides(), self._end + STOPPED
        boxes = {name: box.between(-math.inf, end) for name, box in boxes.items()}
        for name, box in boxes.items():
            if name in robots and len(box.t):
                robots[name].true_arrival = box.arrival
                there = stays.get(name, [(-math.inf, math.inf)])
                robots[name].tracking_error = self._tracking(rides.get(name, []), box, there)
        boxed = bool(rides) and all(name in boxes and len(boxes[name].t) for name in rides)
        times = self._times([boxes[name] for name in rides] if boxed else [])
        names = list(rides)
        tracks = [
            boxes[name].at(times) if boxed else self._by_plan(rides[name], times) for name in names
        ]
        for number, name in enumerate(names):
            if name in stays and len(times):
                is_in = _is_within(times, stays[name])
                tracks[number][~is_in] = np.nan
        for name, near in zip(names, nearest_of_all(times, tracks), strict=False):
            if name not in robots or near.other < 0:
                continue  # It had left before, or no other one was ever in the fleet with it.
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
        begin = max(min(self._starts.values()), self._since)
        return times_between(begin, max([self._end, *ends]))

    def _rides(self) -> dict[str, list[_Ridden]]:
        """Return the rides of every robot, in the order of their times."""
        found = {robot: list(rides) for robot, rides in self._before.items()}
        for course in sorted(self._plans):
            epoch, _, robot = course
            plan = self._plans[course]
            is_begun = course in self._begun or not is_further(plan)
            if epoch not in self._starts or not is_begun:
                continue
            try:
                ride = ride_of_message(plan)
            except ValueError:
                continue
            start = self._starts[epoch]
            since, begin = self._begins[epoch], start
            if is_further(plan):
                since = begin = self._begun[course]
            ridden = _Ridden(since, begin, start, self._driven(course, ride))
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

    def _tracking(
        self, rides: list[_Ridden], box: TrueCourse, stays: Sequence[tuple[float, float]]
    ) -> float | None:
        """Return the greatest distance [m] from the plans while they applied; None without any.

        Rows from before and after the logs are left out: they do not say what was driven then.
        """
        worst: list[float] = []
        turns = [*self._begins.values(), *(one.since for one in rides)]
        for one in rides:
            end = min((at for at in turns if at > one.since), default=self._end)
            begin = max(one.since, self._since)
            for since, until in stays:
                rows = box.between(max(begin, since), min(end, until))
                if len(rows.t):
                    worst.append(rows.off(one.ride, one.start, _ROW))
        return round(max(worst), 6) if worst else None


def _is_within(
    times: Array, spans: Sequence[tuple[float, float]]
) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """Return which times are within one of the spans."""
    found = np.zeros(times.shape, np.bool_)
    for begin, end in spans:
        found |= (times >= begin) & (times < end)
    return found
