"""New times for a fleet under way in which one robot has stopped because it is late.

The paths do not change, nor does the order in which two robots pass a zone: the late robot resumes
later, the robots that pass after it wait longer, and so do those that pass after them.  Before the
switch each robot drives as in the old times, so it may receive the new times at any moment before
the switch.  If this fails, only the late robot gets new times and the others keep theirs.

Decides: new times, or that there are none.  Must not know: messages, clocks.  The same inputs give
the same plan; replay relies on that.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from msgspec.structs import replace

from coordinator.base.errors import InputError, PlanError
from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import Nurbs, nurbs
from coordinator.motion.velocity_profile import Motion, Wait, limits_on, ramp_ends
from coordinator.plan.document import PlanDocument, RobotPlan
from coordinator.plan.drafting import with_new_times
from coordinator.plan.wire import PackedPlan
from coordinator.proof.verify import prove_messages
from coordinator.scenario.model import Scenario
from coordinator.schedule.conflict_zones import Indices
from coordinator.schedule.forbidden_interval_kernels import (
    AFTER,
    BOTH,
    FIRST,
    Passage,
    clash,
    reached,
)
from coordinator.schedule.junctions import Junctions
from coordinator.schedule.lateness import Lateness
from coordinator.schedule.safe_intervals import Begun, rest_of_motion
from coordinator.schedule.timetable import Motions
from coordinator.schedule.track import Track
from coordinator.schedule.wait_reasons import explain_waits

_NEED_PAD: Final = 0.0005
_TAU_PAD: Final = 0.001
"""_NEED_PAD [m] is added to the margin, _TAU_PAD [s] to tau, to allow for rounding to the wire."""

_REPEATS: Final = 6
"""How often one robot may get new times in a search; more would mean a ring of waits."""

_NEARLY_THERE: Final = 0.01
"""A robot that stopped where its plan has it less than this [s] before arrival gets no new times:
it has practically arrived."""

_SAME_PLACE: Final = 1e-4
"""A robot that stands nearer than this [m] to a rest of its plan counts as being at that rest."""


def retime(scenario: Scenario, document: PlanDocument, late: Lateness) -> PackedPlan | None:
    """Return the plan with new times, proven; None when no new times are found.

    `scenario` has to contain the robots of the document; otherwise the result is None.  `document`
    is the plan that the fleet is driving.
    """
    robots = {robot.id for robot in scenario.robots}
    if not all(one.id in robots for one in document.robots):
        return None
    if late.stood >= document.robot(late.robot).finish_time - _NEARLY_THERE:
        return None
    return _Retiming(scenario, document, late).find()


class _Retiming:
    """The fleet of one document in the scheduler's terms, and its motions as they change."""

    def __init__(self, scenario: Scenario, document: PlanDocument, late: Lateness) -> None:
        known = {robot.id: robot for robot in scenario.robots}
        self.document, self.switch = document, late.switch
        self.robots = [known[one.id] for one in document.robots]
        self.paths = [_path(one) for one in document.robots]
        self.tracks = []
        for robot, path in zip(self.robots, self.paths, strict=True):
            speed = scenario.planned_speed(robot)
            limits = limits_on(path, speed, robot.max_accel, robot.max_lateral_accel)
            self.tracks.append(Track(limits, chords_of(path)))
        radii = [one.radius for one in document.robots]
        margin, tau = document.margin + _NEED_PAD, document.tau + _TAU_PAD
        self.junctions = Junctions(self.tracks, radii, margin, tau)
        self.tracks = self.junctions.tracks
        self.driven = [self._motion(index) for index in range(len(self.robots))]
        self.motions = self._as_driven()
        self.orders = [self._order(index) for index in range(len(self.robots))]
        self.late = [robot.id for robot in self.robots].index(late.robot)
        self.begun = [self._begun(index) for index in range(len(self.robots))]
        self.begun[self.late] = self._stands(self.late, late.stood)

    def find(self) -> PackedPlan | None:
        """Return the plan with new times, proven; None when no new times are found."""
        for look in (self._in_order, self._alone):
            changed = look()
            plan = None if changed is None else self._packed(changed)
            if plan is not None:
                return plan
        return None

    def _in_order(self) -> set[int] | None:
        """Give the late robot new times, then all that pass after it and would come too near.

        Returns the robots with new times; None when one of them finds no motion.
        """
        self.motions = self._as_driven()
        waiting, given = [self.late], dict.fromkeys(range(len(self.robots)), 0)
        while waiting:
            index = waiting.pop(0)
            given[index] += 1
            if given[index] > _REPEATS or not self._plan(index, self.orders[index]):
                return None
            waiting += [other for other in self._run_into(index) if other not in waiting]
        return {index for index, times in given.items() if times}

    def _alone(self) -> set[int] | None:
        """Give only the late robot a new motion, among the unchanged motions of the others.

        Returns the late robot's index in a set; None when it finds no motion.
        """
        self.motions = self._as_driven()
        anywhere = np.full(len(self.orders[self.late]), BOTH, dtype=np.int64)
        return {self.late} if self._plan(self.late, anywhere) else None

    def _plan(self, index: int, modes: Indices) -> bool:
        motion = rest_of_motion(self.junctions, self.motions, index, self.begun[index], modes)
        if motion is not None:
            self.motions.put(index, motion)
        return motion is not None

    def _run_into(self, index: int) -> list[int]:
        """Return the robots that pass after this one and come too near with their present times."""
        rows, found = self.junctions.rows_of(index)[0], []
        cell = self.tracks[index].cell
        for k, zone in enumerate(self.junctions.zones_of(index).tolist()):
            other = int(rows.other[k])
            theirs = self.junctions.zones_of(other).tolist().index(zone)
            one = Passage(index, rows, k)
            two = Passage(other, self.junctions.rows_of(other)[0], theirs)
            when = clash(one, two, self.motions.table, cell, self.junctions.tau)
            if when < math.inf and self.orders[index][k] == FIRST and other not in found:
                found.append(other)
        return found

    def _packed(self, changed: set[int]) -> PackedPlan | None:
        """Return the plan with new motions for the changed robots; None unless its proof holds."""
        motions = self.motions.all()
        names = [robot.id for robot in self.robots]
        try:
            fresh = with_new_times(self.document, self.robots, self.paths, motions, changed)
            waits = explain_waits(self.junctions, motions, names, tries=False)
            revision = self.document.revision + 1
            document = replace(fresh.document, waits=waits, revision=revision)
            proof = prove_messages(PackedPlan(document, fresh.messages))
        except (InputError, PlanError):
            return None
        return PackedPlan(replace(document, proof=proof), fresh.messages) if proof.holds else None

    def _motion(self, index: int) -> Motion:
        """Return the motion that a robot drives by the document; its waits name robot and zone."""
        one, zones = self.document.robots[index], self.junctions.zones
        names = [robot.id for robot in self.robots]
        whom = [(0.0, one.start_time, one.start_yields_to)] if one.start_time > 0.0 else []
        whom += [(stop.s, stop.depart, stop.yields_to) for stop in one.stops]
        waits = []
        for s, depart, name in whom:
            owner = names.index(name) if name in names else -1
            ahead = [
                zone
                for zone in self.junctions.zones_of(index).tolist()
                if owner in (zones.a[zone], zones.b[zone])
                and self.junctions.span(index, np.array([zone]))[0, 1] > s
            ]
            waits.append(Wait(s, depart, owner, ahead[0]) if ahead else Wait(s, depart, -1))
        return Motion(self.tracks[index].limits, waits)

    def _as_driven(self) -> Motions:
        motions = Motions(self.junctions.lengths())
        for index, motion in enumerate(self.driven):
            motions.put(index, motion)
        return motions

    def _order(self, index: int) -> Indices:
        """Return for each zone of a robot whether it passes FIRST or AFTER the other robot."""
        rows, table, modes = self.junctions.rows_of(index)[0], self.motions.table, []
        for k, zone in enumerate(self.junctions.zones_of(index).tolist()):
            other = int(rows.other[k])
            theirs = self.junctions.rows_of(other)[0]
            at = self.junctions.zones_of(other).tolist().index(zone)
            mine = reached(table, index, rows.enters[k])
            its = reached(table, other, theirs.enters[at])
            modes.append(FIRST if (mine, index) < (its, other) else AFTER)
        return np.array(modes, dtype=np.int64)

    def _begun(self, index: int) -> Begun:
        """Return the part of a motion that is fixed at the switch.

        It ends at the last rest for which the robot begins to brake before the switch.
        """
        motion, limits = self.driven[index], self.tracks[index].limits
        rests = list(motion.waits)
        if not rests or rests[0].s > 0.0:
            rests.insert(0, Wait(0.0, 0.0, -1))
        last = 0
        for number, rest in enumerate(rests[1:], start=1):
            brakes = float(motion.reached(np.array([ramp_ends(limits, rest.s)[0]]))[0])
            last = number if brakes < self.switch else last
        rest = rests[last]
        goes = rest.depart <= self.switch
        return Begun(
            waits=tuple(wait for wait in rests[:last] if wait in motion.waits),
            s=rest.s,
            release=rest.depart if goes else self.switch,
            leave_by=rest.depart if goes else math.inf,
            beyond=self._first_stop(index, motion.place_at(self.switch)) if goes else rest.s,
        )

    def _first_stop(self, index: int, s: float) -> float:
        """Return the nearest place [m] at which a robot can stop if it begins to brake at s [m]."""
        limits = self.tracks[index].limits
        low, high = s, limits.length
        while high - low > _SAME_PLACE:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if ramp_ends(limits, middle)[0] >= s else (middle, high)
        return high

    def _stands(self, index: int, stood: float) -> Begun:
        """Return the part of the late robot's motion that it has driven, up to where it stands."""
        motion = self.driven[index]
        s = motion.place_at(stood)
        near = [wait.s for wait in motion.waits if abs(wait.s - s) < _SAME_PLACE]
        s = near[0] if near else 0.0 if s < _SAME_PLACE else s
        before = tuple(wait for wait in motion.waits if wait.s < s)
        return Begun(before, s, self.switch, math.inf, s)


def _path(robot: RobotPlan) -> Nurbs:
    path = robot.path
    return nurbs(path.degree, path.knots, np.array(path.control_points), path.weights)
