"""Checks that what a coordinator sent was safe, from its messages alone.

Plans have to be the proven ones; a course with the number of another would be driven on its
authority.

At every Command, need_ij(A_j) < P_i has to hold for all ordered pairs of courses (design section
3).  A_j is the authority on the course behind, P_i the progress that was reported on the course
ahead.  Within tau of each other robots need nothing.

Decides: whether Plans are as proven and Commands keep to the invariant.  Must not know: the rule
that grants authority, how courses are proven, logs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np

from coordinator.plan.course_staircases import CourseStaircases
from coordinator.plan.staircases import Staircases
from coordinator.plan.wire import PackedPlan, unpack
from protocol.codec import encode
from protocol.messages import Command, Plan, Report
from protocol.phases import DONE, GO
from protocol.timing import LATE_STEP_MS

_MOST_AHEAD: Final = 50
"""For so many numbers of courses that are not known yet it is kept what they were granted."""

_AT_GOAL: Final = 0.1
"""Who was let drive so near [m] to the end of its course may be there: plans end slowly."""

_NEAR: Final = 1_000
"""A robot is held when it is let drive for less than this [ms]."""


@dataclass
class _Known:
    """A course: its robot, revision, plan time of its beginning [ms], message, place in tables."""

    robot: str
    revision: int
    begin_ms: int
    message: bytes
    slot: int
    other_slot: int
    """Where the robot's next course has its place."""

    shared_ms: int = 0
    """Until when it is the course before it; where it begins at rest, that is its beginning."""

    is_withdrawn: bool = False
    """Whether others go around its robot, which was sent it and had not said that it drives it."""

    @property
    def is_from_rest(self) -> bool:
        """Whether it begins at rest."""
        return self.shared_ms <= self.begin_ms


class Granted:
    """What one epoch's Commands granted and its Reports told [ms of plan time]; both only grow.

    `plan` has its staircases.
    """

    def __init__(self, plan: PackedPlan) -> None:
        assert plan.staircases is not None
        self.commands = 0
        self.failures: list[str] = []
        self._staircases = CourseStaircases(plan.staircases)
        self._robots = [robot.id for robot in plan.document.robots]
        count = len(self._robots)
        self._courses = {
            number: _Known(robot, 0, 0, plan.messages[robot], number, count + number)
            for number, robot in enumerate(self._robots)
        }
        """By the number in Commands."""
        self._now = dict(zip(self._robots, self._courses.values(), strict=True))
        self._next: dict[str, _Known] = {}
        self._replaced: dict[str, list[_Known]] = {}
        """By robot: withdrawn courses from where it rests, which it may begin although it was sent
        another one since."""

        self._granted = np.zeros(2 * count)
        self._unseen = np.zeros(2 * count)
        """What may have been granted by coordinators that died, and is in no log."""

        self._passed = np.zeros(2 * count)
        self._at_goal = np.zeros(2 * count, bool)
        self._newest = count - 1
        """The greatest number of a course that is known."""

        self._skipped: deque[int] = deque(maxlen=_MOST_AHEAD)
        """Smaller numbers than that, of courses that are not known."""

        self._ahead: dict[int, int] = {}
        """What Commands granted to numbers of courses that were not known yet."""

        self._reported: dict[tuple[str, int], int] = {}
        """By robot and boot id: the sequence number of its newest report."""

        self._left: dict[int, str] = {}
        """By the number of its course: robots that have left the fleet."""

        self.joining: set[str] = set()
        """Robots that may get their first course while the fleet drives."""

        self._names = [*self._robots, *self._robots]
        """The robot of each slot."""

        self._ended: dict[int, float] = {}
        """Slots of courses on which nothing more may be granted, and what was."""

    def join(self, robot: str) -> None:
        """Take in that a robot may get its first course while the fleet drives."""
        if robot not in self._now:
            self.joining.add(robot)

    def leave(self, robot: str) -> None:
        """Take in that a robot is not on the floor any more: nobody has to wait for it."""
        self.joining.discard(robot)
        self._replaced.pop(robot, None)
        for one in (self._now.pop(robot, None), self._next.pop(robot, None)):
            if one is not None:
                self._passed[one.slot], self._at_goal[one.slot] = np.inf, True
                self._ended.pop(one.slot, None)
        kept = {n: one for n, one in self._courses.items() if one.robot != robot}
        self._left.update(dict.fromkeys(self._courses.keys() - kept.keys(), robot))
        self._courses = kept

    def take_plan(self, robot: str, plan: Plan) -> bool:
        """Check that a robot was sent a course that is known, with its own number.

        Returns False for a course that is not known yet, which has to be proven and added.
        """
        known = self._courses.get(plan.number)
        mine = self._now.get(robot)
        if known is None and mine is not None:
            coming = self._next.get(robot)
            is_free = coming is None or coming.is_withdrawn
            if is_free and plan.revision > (coming or mine).revision:
                return False  # One that was withdrawn before it was sent is not in the log.
        if known is None and robot in self.joining and plan.revision == 0:
            return False
        message = encode(msgspec.structs.replace(plan, boot=0))
        if known is None or (message, robot) != (known.message, known.robot):
            name = "nobody" if known is None else known.robot
            whose = "" if name == robot else f"; its number {plan.number} is that of {name}"
            self.failures.append(
                f"the Plan of epoch {plan.epoch} that {robot} was sent is not the one proven{whose}"
            )
        return True

    def add_course(
        self,
        robot: str,
        plan: Plan,
        near: Sequence[tuple[str, int]],
        staircases: Staircases,
        shared_ms: int,
    ) -> None:
        """Take in a course that a robot may begin from now on.

        It takes the place of one that was withdrawn before the robot began it.

        `staircases`: those of the course, index 0, with the courses of `near` (robot, revision).
        `shared_ms`: until when it is the robot's course in force as well.
        """
        now, coming = self._now.get(robot), self._next.get(robot)
        is_withdrawn = coming is not None
        if coming is not None and coming.is_from_rest:
            self._replaced.setdefault(robot, []).append(coming)
        slot = self._new_slots(robot) if now is None or is_withdrawn else now.other_slot
        message = encode(msgspec.structs.replace(plan, boot=0))
        other = slot + 1 if now is None else now.slot
        course = _Known(robot, plan.revision, plan.begin_ms, message, slot, other, shared_ms)
        self._courses[plan.number] = course
        (self._now if now is None else self._next)[robot] = course
        self.joining.discard(robot)
        self._staircases.put(slot, staircases, [slot, *(self._slot_of(*one) for one in near)])
        self._skipped.extend(range(self._newest + 1, plan.number))
        self._newest = max(self._newest, plan.number)
        # There, or as far as it was let drive on the same way, it may be without being let drive.
        may_be = plan.begin_ms if now is None else min(self._granted[now.slot], shared_ms)
        self._granted[slot] = max(self._ahead.pop(plan.number, 0), plan.begin_ms, may_be)
        self._unseen[slot] = 0.0 if now is None else min(self._unseen[now.slot], shared_ms)
        self._at_goal[slot] = False
        passed = plan.begin_ms if now is None else self._passed[now.slot]
        self._passed[slot] = min(passed, shared_ms)

    def _new_slots(self, robot: str) -> int:
        """Make room for the courses of a robot that joins; return the first of its slots."""
        first = len(self._names)
        self._names += [robot, robot]
        self._granted, self._unseen, self._passed = (
            np.append(one, np.zeros(2)) for one in (self._granted, self._unseen, self._passed)
        )
        self._at_goal = np.append(self._at_goal, [False, False])
        return first

    def _slot_of(self, robot: str, revision: int) -> int:
        known = (self._now.get(robot), self._next.get(robot))
        slots = [one.slot for one in known if one is not None and one.revision == revision]
        return slots[0] if slots else -1

    def take_report(self, robot: str, report: Report) -> bool:
        """Take in a robot's progress; it counts no further than what it may have been granted.

        Return whether the report is newer than all before it of that process; else it is nothing.

        A robot at its goal has passed all plan times, and no Command lets it drive on; it is not
        there if none has let it drive to its goal.
        """
        newest = self._reported.get((robot, report.boot), -1)
        if report.sequence <= newest:
            return False
        self._reported[robot, report.boot] = report.sequence
        self._take_progress(robot, report)
        return True

    def _take_progress(self, robot: str, report: Report) -> None:
        for one in (self._next.get(robot), *self._replaced.get(robot, ())):
            if one is not None and report.revision == one.revision:
                self._begin(robot, one)
        known = self._now.get(robot)
        if known is None or known.revision != report.revision:
            if known is not None and report.revision > known.revision:
                text = f"{robot} drives course {report.revision}, which the log does not hold"
                if text not in self.failures:
                    self.failures.append(text)
            return
        if known.is_withdrawn and known.is_from_rest:
            return  # It rests where that begins, and has passed no more of the course before.
        slot = known.slot
        if report.phase == DONE:
            if self._may_be_at_goal(known):
                self._passed[slot], self._at_goal[slot] = np.inf, True
        elif report.stamp_ms is not None:
            passed = report.stamp_ms - LATE_STEP_MS * report.late
            passed = min(passed, int(max(self._granted[slot], self._unseen[slot])))
            self._passed[slot] = max(self._passed[slot], passed)
        coming = self._next.get(robot)
        if coming is not None:
            least = min(self._passed[slot], coming.shared_ms)
            self._passed[coming.slot] = max(self._passed[coming.slot], least)

    def _may_be_at_goal(self, known: _Known) -> bool:
        """Return whether a robot may have been let drive to the end of its course."""
        if self._at_goal[known.slot]:
            return True
        line = unpack(known.message, 0.0).timeline
        most = max(float(self._granted[known.slot]), float(self._unseen[known.slot]))
        return line.s_at(0.001 * most) >= line.length - _AT_GOAL

    def _begin(self, robot: str, coming: _Known) -> None:
        """Take in that a robot has left its course for the next one, or one that it replaced.

        On one that was withdrawn it is where the old one has it as well, or where it rested on
        that: it takes the old one's place, and others wait for what the robot has passed of that.
        """
        old, self._now[robot] = self._now[robot], coming
        if self._next.get(robot) is coming:
            del self._next[robot]
        left = self._replaced.pop(robot, ())
        self._replaced[robot] = [one for one in left if one.revision > coming.revision]
        self._courses = {n: one for n, one in self._courses.items() if one is not old}
        if coming.is_withdrawn:
            slot, own = old.slot, coming.slot
            self._granted[slot] = min(self._granted[slot], self._granted[own])
            self._ended[slot], self._at_goal[slot] = self._ended.pop(own), False
            coming.slot, coming.other_slot = slot, own
            return
        self._passed[old.slot], self._at_goal[old.slot] = np.inf, True
        self._ended.pop(old.slot, None)
        self._passed[coming.slot] = max(self._passed[coming.slot], coming.begin_ms)

    def lose_sight(self, until_ms: int) -> None:
        """Take in that a log ends, and may lack Commands that granted up to a plan time."""
        for one in (*self._now.values(), *self._next.values()):
            if one.slot not in self._ended:
                self._unseen[one.slot] = max(self._unseen[one.slot], until_ms)

    def end_grants(self, robot: str) -> None:
        """Take in that a robot is granted nothing more on its course: others go around it."""
        slot, coming = self._now[robot].slot, self._next.get(robot)
        self._ended[slot] = float(self._granted[slot])
        if coming is not None:  # It is withdrawn, and holds nobody.
            ended = max(float(coming.begin_ms), float(self._granted[coming.slot]))
            self._ended[coming.slot], self._passed[coming.slot] = ended, np.inf
            coming.is_withdrawn = True

    def stretch_of(self, robot: str) -> tuple[float, float]:
        """Return the plan times [ms] between which a robot stands that is granted nothing more."""
        slot = self._now[robot].slot
        return float(self._passed[slot]), self._ended[slot]

    def stretches(self, robot: str) -> list[tuple[int, float, float]]:
        """Return where a robot may be: revisions of its courses, and from and to which time [ms].

        Times are infinite for a robot at the goal of a course.
        """
        courses = (self._now.get(robot), self._next.get(robot))
        found = []
        for one in courses:
            if one is None or one.is_withdrawn:
                continue
            since = float(self._passed[one.slot])
            most = max(float(self._granted[one.slot]), float(self._unseen[one.slot]), one.begin_ms)
            until = min(most, self._ended.get(one.slot, math.inf))
            found.append((one.revision, since, math.inf if math.isinf(since) else until))
        return found

    def take_command(self, command: Command) -> None:
        """Take in what a Command grants, and check the invariant."""
        if command.phase != GO:
            return
        self.commands += 1
        newest = range(self._newest + 1, min(command.last + 1, self._newest + _MOST_AHEAD))
        for number in (*self._skipped, *newest):
            said = command.authority_of(number) or 0
            self._ahead[number] = max(self._ahead.get(number, 0), said)
        for number, one in self._courses.items():
            stated = command.authority_of(number)
            if stated is not None and not self._at_goal[one.slot]:
                self._granted[one.slot] = max(self._granted[one.slot], stated)
                if self._granted[one.slot] > self._ended.get(one.slot, np.inf):
                    self.failures.append(
                        f"Command {command.sequence} of epoch {command.epoch} lets {one.robot} "
                        "drive on, which others go around"
                    )
        for number, robot in self._left.items():
            if command.authority_of(number):
                self.failures.append(
                    f"Command {command.sequence} of epoch {command.epoch} lets {robot} drive, "
                    "which has left the fleet"
                )
        for robot, one in self._next.items():
            most = min(one.shared_ms, self._granted[self._now[robot].slot])
            if self._granted[one.slot] > max(most, one.begin_ms):
                self.failures.append(
                    f"Command {command.sequence} of epoch {command.epoch} lets {robot} drive on "
                    f"course {one.revision}, which it has not said that it drives, beyond "
                    f"{most / 1000.0:.3f} s"
                )
        stairs = self._staircases.all
        ahead, behind = self._passed[stairs.ahead], self._granted[stairs.behind]
        for pair in np.flatnonzero(behind - stairs.tau_ms >= ahead).tolist():
            need = stairs.need_at(pair, float(behind[pair]))
            if need >= ahead[pair]:
                self.failures.append(self._text(command, pair, need))

    def names(self, numbers: Sequence[int]) -> list[str]:
        """Return the robots whose courses have these numbers."""
        return [self._courses[number].robot for number in numbers if number in self._courses]

    def spoken_to(self, command: Command) -> set[str]:
        """Return the robots of whose courses a Command speaks."""
        courses = self._courses.items()
        return {one.robot for n, one in courses if command.first <= n <= command.last}

    def holder(self, robot: str) -> str | None:
        """Return a robot that another one has to wait for; None when nobody holds it.

        Beyond what it was granted, it needs the robot returned to have passed more than it has.  A
        robot that has _NEAR or more of that left to drive is not held yet.
        """
        stairs, slot = self._staircases.all, self._now[robot].slot
        if self._granted[slot] - self._passed[slot] >= _NEAR:
            return None
        next_ms = float(self._granted[slot]) + 1.0
        for pair in np.flatnonzero(stairs.behind == slot).tolist():
            ahead = int(stairs.ahead[pair])
            if stairs.need_at(pair, next_ms) >= self._passed[ahead]:
                return self._name(ahead)
        return None

    def _name(self, slot: int) -> str:
        return self._names[slot]

    def _text(self, command: Command, pair: int, need: float) -> str:
        stairs = self._staircases.all
        who, other = self._name(int(stairs.behind[pair])), self._name(int(stairs.ahead[pair]))
        granted, passed = self._granted[stairs.behind[pair]], self._passed[stairs.ahead[pair]]
        return (
            f"Command {command.sequence} of epoch {command.epoch} grants {who} plan time "
            f"{granted / 1000.0:.3f} s; {other} must have passed {need / 1000.0:.3f} s and has "
            f"reported {passed / 1000.0:.3f} s"
        )
