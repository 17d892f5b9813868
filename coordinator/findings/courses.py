"""Computes where a log's robots were over time, from their plans and their black boxes.

Decides: which plan a robot followed at which time, how far from it the robot truly was, and who
came nearest to whom.  Must not know: files, how numbers are shown.  Times are seconds since the
log's zero, see info.py.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

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


class Courses:
    """The robots' courses; `info` calls `hear` with every valid message of the fleet.

    `zero_ns`: the log time that counts as 0.  `lag_ns`: how far the log's clock is ahead of the
    coordinator's.  `boot`: the coordinator whose Commands count, "" for any.
    """

    def __init__(self, zero_ns: int, lag_ns: int, boot: str) -> None:
        self._zero_ns, self._lag_ns, self._boot = zero_ns, lag_ns, boot
        self._plans: dict[tuple[int, str], Plan] = {}
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
                self._said.begin(message.epoch, start_ns)
            elif message.phase == phases.FREEZE and self._starts:
                self._frozen.setdefault(max(self._starts), record.log_ns)
        elif isinstance(message, Plan):
            self._plans.setdefault((message.epoch, robot), message)
        elif isinstance(message, Report):
            self._said.take(message, robot, record.log_ns)

    def fill(self, robots: Mapping[str, RobotSummary], boxes: Mapping[str, TrueCourse]) -> None:
        """Fill in each robot's nearest other robot, and the fields that need a black box.

        Distances come from the black boxes if every robot that drove has one, else from the plans.
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
        for name, near in zip(names, nearest_of_all(times, tracks), strict=False):
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

    def _rides(self) -> dict[str, list[tuple[int, RideSamples]]]:
        """Return the rides of every robot, in the order of the epochs."""
        found: dict[str, list[tuple[int, RideSamples]]] = {}
        for epoch, robot in sorted(self._plans):
            if epoch in self._starts:
                try:
                    ride = ride_of_message(self._plans[epoch, robot])
                except ValueError:
                    continue
                found.setdefault(robot, []).append((epoch, self._driven(epoch, robot, ride)))
        return found

    def _driven(self, epoch: int, robot: str, ride: RideSamples) -> RideSamples:
        """Return the ride as the robot drove it: late, and to where it left its plan."""
        start_ns = self._zero_ns + round(self._starts[epoch] * SECOND)
        words = self._said.of(epoch, robot)
        return ride.driven(
            words.driving(ride.line, ride.brake_rate, start_ns, self._frozen.get(epoch))
        )

    def _by_plan(self, rides: list[tuple[int, RideSamples]], times: Array) -> Array:
        """Return a robot's places by its plans, (n, 2).

        The robot is at rest before, between and after its plans.
        """
        places = np.empty((len(times), 2))
        begins = [self._starts[epoch] for epoch, _ in rides]
        which = np.maximum(np.searchsorted(begins, times, side="right") - 1, 0)
        for number, (epoch, ride) in enumerate(rides):
            mine = which == number
            places[mine] = ride.places_at(ride.driven_at(times[mine] - self._starts[epoch]))
        return places

    def _tracking(self, rides: list[tuple[int, RideSamples]], box: TrueCourse) -> float | None:
        """Return the greatest distance [m] from the plans while they applied; None without any."""
        worst: list[float] = []
        for epoch, ride in rides:
            later = [at for other, at in self._begins.items() if other > epoch]
            rows = box.between(self._begins[epoch], min(later, default=math.inf))
            if len(rows.t):
                worst.append(rows.off(ride, self._starts[epoch], _ROW))
        return round(max(worst), 6) if worst else None
