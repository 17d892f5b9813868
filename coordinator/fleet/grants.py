"""The courses of a fleet's robots, and the authority on them as Commands state it.

A robot has a course in force and at most one that it was sent and has not begun.  Before it reports
that it drives that one, it is granted nothing on it but where it is the course in force as well.
So it is always on one known course.

Decides: which courses robots may be driving, how authorities are divided among Commands.  Must not
know: phases, when a Command is sent.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import msgspec
import numpy as np

from coordinator.fleet.authority_ends import ROOM, AuthorityEnds
from coordinator.fleet.sent_courses import Courses, PlainSent, Sent, Span
from coordinator.fleet.standstills import LATELY_MS, Standstills
from coordinator.plan.course import Course
from coordinator.plan.course_staircases import CourseStaircases
from coordinator.plan.staircases import NO_STAIRCASES, PlainStaircases, Staircases
from coordinator.proof.shared_course import shared_until
from coordinator.schedule.authority import EVER, Authority, PlainAuthority
from protocol.messages import MOST_HELD, Report
from protocol.phases import DONE
from protocol.timing import LATE_STEP_MS

LATE_MS: Final = 1_500
"""A robot that is known to be behind its course by this much is late, and not only its reports."""

_NEAR_MS: Final = LATELY_MS
"""A robot that others let drive on for less than this is near the end of its authority.

It is held if it should have been there already."""

_ROOM_MS: Final = 1_000
"""A robot may claim to have passed this much more than it was told, by the steps of its reports."""


class Stated(NamedTuple):
    """What a Command states: the headroom [ms], who has less, and of which numbers it speaks."""

    headroom_ms: int = 0
    held: tuple[tuple[int, int], ...] = ()
    first: int = 0
    last: int = 0


class PlainGrants(msgspec.Struct, frozen=True):
    """Grants as plain data, for a checkpoint; arrays as their bytes."""

    headroom_ms: int
    robots: list[str]
    names: list[str]
    staircases: PlainStaircases
    authority: PlainAuthority
    courses: dict[str, tuple[PlainSent, PlainSent | None, tuple[int, int]]]
    numbers: bytes
    done: bytes
    got_on_ms: bytes
    passed_ms: bytes
    got_on_latest_ms: int
    next_number: int
    reserved: list[int]
    limits: dict[str, int]
    given_up: list[str]
    held: list[tuple[int, int, int]]
    ends: dict[str, int] = {}
    kept_from: dict[str, str] = {}
    replaced: dict[str, list[PlainSent]] = {}
    held_for_long: list[int] = []


class Grants:
    """The courses and authorities of the robots of one plan; `robots` in the order of its zones.

    `headroom_ms`: how far ahead of the plan's time a robot may drive when nobody holds it.  That is
    enough to drive on when Commands are lost, and then to brake.  A robot's first course has its
    place in `robots` as its number.  `courses`: the robots' first courses.
    """

    def __init__(
        self,
        staircases: Staircases,
        robots: Sequence[str],
        headroom_ms: int,
        courses: Sequence[Course] = (),
    ) -> None:
        count = len(robots)
        self.headroom_ms = headroom_ms
        self._robots = list(robots)
        self._names = [*robots, *robots]
        """The robot of each slot."""

        self._staircases = CourseStaircases(staircases)
        self._rule = Authority(staircases, 2 * count)
        self._rule.barred[count:] = True
        self._courses = {
            name: Courses(
                Sent(slot, slot, course=courses[slot] if courses else None),
                slots=(slot, count + slot),
            )
            for slot, name in enumerate(robots)
        }
        self._numbers = np.full(2 * count, -1, np.int64)
        """The number of the course in each slot; -1 where there is none."""
        self._numbers[:count] = np.arange(count)
        self._next_number = count
        self._reserved: set[int] = set()
        """Numbers on which nothing is granted: of courses looked for or withdrawn, and
        of robots that were taken out."""
        self.standstills = Standstills(self._names)
        self.ends = AuthorityEnds(self._rule, self._courses, self.standstills)
        self._done = np.zeros(2 * count, bool)

    @property
    def given_up(self) -> set[str]:
        """Robots that are granted nothing more on the course in force, for ever."""
        return self.ends.given_up

    def plain(self) -> PlainGrants:
        """Return the grants as plain data."""
        courses = {
            name: (
                PlainSent.of(mine.now),
                None if mine.next is None else PlainSent.of(mine.next),
                mine.slots,
            )
            for name, mine in self._courses.items()
        }
        return PlainGrants(
            self.headroom_ms,
            self._robots,
            self._names,
            PlainStaircases.of(self._staircases.all),
            self._rule.plain(),
            courses,
            self._numbers.tobytes(),
            self._done.tobytes(),
            self.standstills.got_on_ms.tobytes(),
            self.standstills.passed_ms.tobytes(),
            self.standstills.got_on_latest_ms,
            self._next_number,
            sorted(self._reserved),
            self.ends.limits,
            sorted(self.given_up),
            [(slot, *held) for slot, held in self.standstills.by_slot.items()],
            self.ends.halts,
            self.standstills.kept_from,
            {
                name: [PlainSent.of(one) for one in mine.replaced]
                for name, mine in self._courses.items()
                if mine.replaced
            },
            sorted(self.standstills.for_long),
        )

    @classmethod
    def of_plain(cls, told: PlainGrants) -> Grants:
        """Return the grants; raise ValueError if a robot would refuse one of the courses."""
        staircases = told.staircases.staircases()
        made = cls(staircases, told.robots, told.headroom_ms)
        made._names = told.names
        made._rule = Authority.of_plain(staircases, told.authority)
        made._courses = {
            name: Courses(now.sent(), None if coming is None else coming.sent(), slots)
            for name, (now, coming, slots) in told.courses.items()
        }
        for name, mine in made._courses.items():
            mine.replaced = [one.sent() for one in told.replaced.get(name, ())]
            if mine.next is not None and not mine.next.is_withdrawn:
                made._run_along(mine.now, mine.next)
        made.standstills = still = Standstills(made._names)
        made._numbers, still.got_on_ms, still.passed_ms = (
            np.frombuffer(one, np.int64).copy()
            for one in (told.numbers, told.got_on_ms, told.passed_ms)
        )
        still.got_on_latest_ms = told.got_on_latest_ms
        still.by_slot = {slot: (by, since) for slot, by, since in told.held}
        made._done = np.frombuffer(told.done, bool).copy()
        made._next_number, made._reserved = told.next_number, set(told.reserved)
        still.kept_from, still.for_long = told.kept_from, set(told.held_for_long)
        made.ends = AuthorityEnds(made._rule, made._courses, still)
        made.ends.take_over(told.limits, told.ends, set(told.given_up))
        return made

    def in_force(self) -> tuple[list[Course], Staircases]:
        """Return the courses that robots may be driving, and the staircases between them.

        Each counts from where its robot is known to be on it, and not before it begins.  Those of
        robots that were given up are left out, as in `possible`.
        """
        counted = {id(course) for course in self.possible()}
        courses, slots = [], []
        for mine in self._courses.values():
            for one in mine:
                if one.course is not None and id(one.course) in counted:
                    passed_ms = max(int(self._rule.progress[one.slot]), one.begin_ms)
                    since = min(passed_ms / 1000.0, one.course.driven.timeline.finish)
                    courses.append(Course(one.course.driven, since))
                    slots.append(one.slot)
        return courses, self._staircases.among(slots)

    def of(self, robot: str) -> Courses | None:
        """Return a robot's courses; None if it has no part in the plan."""
        return self._courses.get(robot)

    def possible(self) -> list[Course]:
        """Return all courses that robots may be driving, given up ones left out."""
        sent = (
            one.course
            for name, mine in self._courses.items()
            for one in mine
            if not one.is_withdrawn and (one is not mine.now or name not in self.given_up)
        )
        return [course for course in sent if course is not None]

    def give_up(self, robot: str) -> None:
        """Grant nothing more on a robot's course for ever: others are sent around where it is."""
        self.ends.give_up(robot)
        coming = self._courses[robot].next
        if coming is not None:
            coming.is_withdrawn = True
            self._rule.reach(coming.slot, EVER)
            self._rule.barred[coming.slot] = True

    def was_given_up(self, courses: Iterable[Course]) -> bool:
        """Return whether a robot was given up on one of these courses, and still is."""
        now = [
            (one.driven, self._courses[one.driven.id].now.course)
            for one in courses
            if one.driven.id in self.given_up
        ]
        return any(course is not None and course.driven is driven for driven, course in now)

    def is_over(self, robot: str) -> bool:
        """Return whether a robot was given up on its course, and on one sent to it since then."""
        coming = self._courses[robot].next
        return robot in self.given_up and (coming is None or coming.is_withdrawn)

    def reserve(self) -> int:
        """Return a number for a course that is being looked for.

        Nothing is granted to it before the course is committed.
        """
        number, self._next_number = self._next_number, self._next_number + 1
        self._reserved.add(number)
        return number

    def release(self, number: int) -> None:
        """Give up a number that was reserved."""
        self._reserved.discard(number)

    def arrival_ms(self, robot: str, now_ms: int) -> int | None:
        """Return the plan time [ms] when a robot will be at the end of the course in force.

        It is as late then as it is known to be at `now_ms`.  None if it may still be held on the
        way: not all of the course is granted to it, or nothing more ever is.
        """
        mine = self._courses[robot]
        if mine.now.course is None or robot in self.given_up:
            return None
        finish_ms = math.ceil(1000.0 * mine.now.course.driven.timeline.finish)
        if self._rule.granted[mine.now.slot] < finish_ms:
            return None
        return finish_ms + round(1000.0 * self.late(now_ms).get(robot, 0.0))

    def waited_for_ms(self, robot: str) -> list[float]:
        """Return which plan times [ms] the robots that one holds wait for it to pass."""
        slot, stairs = self._courses[robot].now.slot, self._staircases.all
        pairs = [
            (pair, behind)
            for behind, (by, _) in self.standstills.by_slot.items()
            if by == slot
            for pair in np.flatnonzero((stairs.behind == behind) & (stairs.ahead == by)).tolist()
        ]
        ends = self._rule.granted + self.headroom_ms
        return [stairs.need_at(pair, float(ends[behind])) for pair, behind in pairs]

    def commit(
        self,
        number: int,
        course: Course,
        near: Sequence[Course],
        staircases: Staircases,
    ) -> bool:
        """Add a course that its robot may begin from now on; False if what was told forbids it.

        `staircases`: those of the course, index 0, with the courses `near`, from index 1 on.
        """
        plan, robot = course.driven.plan, course.driven.id
        mine, begin_ms = self._courses.get(robot), plan.begin_ms
        slot = self._new_slots(robot) if mine is None else mine.free_slot
        passed_ms = begin_ms if mine is None else int(self._rule.progress[mine.now.slot])
        slots = [slot, *(self._slot(one) for one in near)]
        self._staircases.put(slot, staircases, slots)
        told_ms = shared_ms = begin_ms
        if mine is not None and mine.now.course is not None:
            shared = shared_until(mine.now.course.driven, course.driven)
            shared_ms = max(math.floor(1000.0 * shared + 1e-6), begin_ms)
            told_ms = max(min(self.ends.told_ms(robot), shared_ms), begin_ms)
        self._rule.open(slot, min(passed_ms, shared_ms), told_ms)
        mine_only = self._staircases.of(slot)
        fits = self._rule.allows(mine_only)
        if not fits:
            by = self._rule.holder_of(slot, mine_only)
            if by is not None:
                self.standstills.keep_from(robot, by)
            self._staircases.put(slot, NO_STAIRCASES, ())
        self._rule.renew(self._staircases.all)
        if not fits:
            return False
        self.standstills.await_start(slot, begin_ms)
        self.release(number)
        sent = Sent(slot, number, plan.revision, begin_ms, course, shared_ms=shared_ms)
        if mine is None:
            sent.course = course.begun()
            self._courses[robot] = Courses(sent, slots=(slot, slot + 1))
            self._rule.barred[slot] = False
        else:
            if mine.next is not None:
                self._reserved.add(mine.next.number)  # Nothing is ever granted on it.
                mine.replaced += [mine.next] if mine.next.is_from_rest else []
            mine.next = sent
            self._run_along(mine.now, sent)
        self._numbers[slot], self._done[slot] = number, False
        return True

    def keep_from(self, robot: str, by: str) -> None:
        """Take in that no course is found for a robot before another one has passed."""
        if by in self._courses:
            self.standstills.keep_from(robot, self._courses[by].now.slot)

    def _run_along(self, now: Sent, coming: Sent) -> None:
        """Grant on a course that has not begun as far as it is the one in force."""
        if coming.shared_ms > coming.begin_ms:
            self._rule.follow(coming.slot, now.slot, coming.shared_ms)

    def _new_slots(self, robot: str) -> int:
        """Make room for the courses of a robot that joins; return the first of its slots."""
        first = len(self._names)
        if robot not in self._robots:
            self._robots.append(robot)
        self._names += [robot, robot]
        self._rule.grow(2)
        self._numbers = np.append(self._numbers, [-1, -1])
        self._done = np.append(self._done, [False, False])
        self.standstills.grow()
        return first

    def remove(self, robot: str) -> None:
        """Take out a robot, which is not on the floor any more.

        Its courses stay named, with nothing granted: it may be there after all, and hear Commands.
        """
        mine = self._courses.pop(robot, None)
        for one in mine or ():
            self._reserved.add(one.number)
            self._rule.arrive(one.slot)
            self._rule.barred[one.slot], self._numbers[one.slot] = True, -1
        self.standstills.remove(robot, [one.slot for one in mine or ()])
        self.ends.forget(robot)

    def _slot(self, course: Course) -> int:
        """Return the slot of a course, or -1 if its robot has left it for a newer one."""
        driven = course.driven
        slots = [
            one.slot
            for one in self._courses.get(driven.id, ())
            if one.course is not None and one.course.driven is driven
        ]
        return slots[0] if slots else -1

    def hear(self, robot: str, report: Report, now_ms: int) -> bool:
        """Take in how far a robot says that it has driven; return whether it can be there.

        `now_ms`: the plan time at which the report is heard.
        """
        mine = self._courses.get(robot)
        if mine is None:
            return True
        if max(report.revision, report.holds) > mine.newest.revision:
            return False  # Another coordinator has sent it that course.
        for one in (mine.next, *mine.replaced):
            if one is not None and report.revision == one.revision:
                self._begin(mine, one, now_ms)
        if report.revision != mine.now.revision:
            return True
        fits = self._hear_progress(mine.now, report, now_ms)
        if mine.next is not None:
            passed_ms = int(self._rule.progress[mine.now.slot])
            self._rule.reach(mine.next.slot, min(passed_ms, mine.next.shared_ms))
        return fits

    def _begin(self, mine: Courses, begun: Sent, now_ms: int) -> None:
        """Take in that a robot has left its course for the next one, or one that it replaced."""
        old, mine.now, is_next = mine.now, begun, begun is mine.next
        mine.next = None if is_next else mine.next
        mine.replaced = [one for one in mine.replaced if one.revision > begun.revision]
        begun.course = None if begun.course is None else begun.course.begun()
        robot, rule = self._names[begun.slot], self._rule
        self.ends.limits.pop(robot, None)
        if begun.is_withdrawn:
            self._take_place(begun, old, begun.slot if is_next else -1)
            return
        self.ends.forget(robot)
        rule.reach(begun.slot, begun.begin_ms)
        rule.reach(old.slot, EVER)
        rule.part(begun.slot)
        rule.barred[old.slot] = True
        self._numbers[old.slot] = -1
        self.standstills.begin(begun.slot, old.slot, now_ms)

    def _take_place(self, begun: Sent, old: Sent, own: int) -> None:
        """Let a withdrawn course that was begun take the old one's place in the tables.

        Its robot can be nowhere but where the old one has it as well, or where it rested on that.
        So those behind it wait for what it has passed of the old one, until it drives another.
        `own`: its own slot, -1 if the course that replaced it has that.
        """
        rule, slot = self._rule, old.slot
        granted_ms = told_ms = begun.begin_ms
        if own >= 0:
            granted_ms, told_ms = int(rule.granted[own]), int(rule.told[own])
            self._numbers[own] = -1
        rule.granted[slot] = min(int(rule.granted[slot]), granted_ms)
        rule.told[slot] = min(int(rule.told[slot]), told_ms)
        rule.barred[slot], self._done[slot] = True, False
        self._reserved.discard(begun.number)
        self._numbers[slot], begun.slot = begun.number, slot

    def _hear_progress(self, sent: Sent, report: Report, now_ms: int) -> bool:
        slot = sent.slot
        if sent.is_withdrawn and sent.is_from_rest:
            return True  # It rests where it begins, and has passed no more of the one before.
        is_done = report.phase == DONE
        if is_done and sent.course is not None:
            finish_ms = math.floor(1000.0 * sent.course.driven.timeline.finish)
            if not self._can_be_at(sent, finish_ms):
                return False
        self._done[slot] = is_done
        if is_done:
            self._rule.arrive(slot)
            if sent.course is not None:
                sent.course = sent.course.arrived(report.stamp_ms)
        if report.stamp_ms is None or self._rule.progress[slot] == EVER:
            return True
        claimed_ms = report.stamp_ms - LATE_STEP_MS * report.late
        self._rule.know(slot, claimed_ms)
        self.standstills.drive(slot, int(self._rule.progress[slot]), now_ms)
        return self._can_be_at(sent, claimed_ms)

    def _can_be_at(self, sent: Sent, claimed_ms: int) -> bool:
        """Return whether a robot can be where its plan has it at a plan time, by what it was told.

        One that waits by its plan is there until the wait ends, which may be long after that.
        """
        told_ms = int(self._rule.told[sent.slot])
        if claimed_ms <= told_ms + _ROOM_MS or sent.course is None:
            return claimed_ms <= told_ms + _ROOM_MS
        line = sent.course.driven.timeline
        return line.s_at(claimed_ms / 1000.0) <= line.s_at(told_ms / 1000.0) + ROOM

    def grant(self, now_ms: int, most_ms: int) -> list[Stated]:
        """Grant what is safe at a plan time [ms], at most up to `most_ms`.

        Return what the Commands state of it; there are several if more courses have less than the
        headroom than one Command can name.
        """
        rule = self._rule
        rule.grant(now_ms, self.headroom_ms, most_ms)
        self._note_held(now_ms, most_ms)
        most = min(now_ms + self.headroom_ms, most_ms)
        less = np.flatnonzero((rule.granted < most) & ~self._done & (self._numbers >= 0))
        pairs = zip(self._numbers[less].tolist(), rule.granted[less].tolist(), strict=True)
        named = sorted([*pairs, *((number, 0) for number in self._reserved)])
        parts = [named[k : k + MOST_HELD] for k in range(0, max(len(named), 1), MOST_HELD)]
        ends = [-1, *(part[-1][0] for part in parts[:-1]), self._next_number - 1]
        return [
            Stated(most - now_ms, tuple(part), begin + 1, end)
            for part, (begin, end) in zip(parts, pairwise(ends), strict=True)
        ]

    def _note_held(self, now_ms: int, most_ms: int) -> None:
        rule, got_on_ms = self._rule, self.standstills.got_on_ms
        wanted = np.minimum(rule.unlimited(now_ms, self.headroom_ms), most_ms)
        is_near = (rule.granted < wanted) & (rule.granted - rule.progress < _NEAR_MS) & ~self._done
        is_near &= rule.leads < 0
        halted = [one.now.slot for one in self._courses.values() if one.begins_at_rest(now_ms)]
        is_near[halted] &= rule.granted[halted] < rule.most[halted]  # Nobody holds those.
        got_on_ms[is_near] = now_ms
        for name, limit_ms in self.ends.limits.items():
            slot = self._courses[name].now.slot
            if rule.granted[slot] >= limit_ms and slot not in halted:
                got_on_ms[slot] = now_ms  # It stands before a place that is closed.
        held = np.flatnonzero(is_near & (rule.granted < now_ms)).tolist()
        self.standstills.hold({slot: rule.holder_of(slot) for slot in held}, now_ms)

    def stuck(self, now_ms: int) -> set[str]:
        """Return the robots that are stuck; one that has a course to begin is not."""
        could_drive = ~self._done & (self._numbers >= 0)
        begin = [one.next.slot for one in self._courses.values() if one.next is not None]
        could_drive[begin] = False
        return self.standstills.stuck(could_drive, now_ms)

    def gets_on(self, robot: str, now_ms: int) -> bool:
        """Return whether a robot has got on lately, or could not."""
        return self.standstills.gets_on(self._courses[robot].now.slot, now_ms)

    def late(self, now_ms: int) -> dict[str, float]:
        """Return how late [s] robots are at a plan time [ms], those that are by LATE_MS or more."""
        found = {}
        for name, mine in self._courses.items():
            behind_ms = now_ms - int(self._rule.progress[mine.now.slot])
            if behind_ms >= LATE_MS and mine.now.begin_ms < now_ms:
                found[name] = behind_ms / 1000.0
        return found

    def lose_sight(self, until_ms: int) -> None:
        """Take in that robots may have been told more, up to a plan time, than is known.

        Those that were given up were not, but on a course that they were sent since.
        """
        slots = [
            one.slot
            for name, mine in self._courses.items()
            for one in mine
            if not one.is_withdrawn and (one is not mine.now or name not in self.given_up)
        ]
        self._rule.may_have_told(np.array(slots, np.int64), until_ms)

    def spans(self, robot: str) -> list[Span]:
        """Return the parts of its courses on which a robot is: known to have passed, told."""
        mine, rule = self._courses.get(robot), self._rule
        if mine is None:
            return [Span(0, 0, 0)]
        return [
            Span(one.revision, int(rule.progress[one.slot]), int(rule.told[one.slot]))
            for one in mine
            if one is mine.now or rule.told[one.slot] > one.begin_ms
        ]


NOBODY: Final = Grants(NO_STAIRCASES, (), 0)
"""The grants of an epoch in which no robot drives."""
