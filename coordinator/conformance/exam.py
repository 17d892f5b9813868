"""One robot under examination: what a script may use, and the findings.

Decides: how a robot is brought to the start of a course, and what its reports claim.  Must not
know: the exchanges that are tried.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, NamedTuple

from coordinator.conformance.courses import CLOCK_MS, TRACK_MM, Course, Pace, Pose, course_from
from coordinator.conformance.requirements import REQUIREMENTS
from coordinator.conformance.stage import PATIENCE_MS, Stage
from coordinator.conformance.wire_forms import plain
from protocol.messages import MOST_NUMBER, Hello, Report
from protocol.phases import ARMED, DONE, FREEZE, FROZEN, GO, HOLD, IDLE, MOVING, PHASE_NAMES
from protocol.timing import LATE_STEP_MS, MILLISECOND, SECOND

AHEAD: Final = 500 * MILLISECOND
"""How long [ns] after the first Command with GO the plan starts."""

ROUNDING_MS: Final = LATE_STEP_MS
"""A claim is rounded to this."""

SEEMS_M: Final = 0.2 * TRACK_MM / 1000.0 + 0.001
"""A robot may seem to be so much [m] farther than it is."""


class Until(NamedTuple):
    """A script waits until `met`, or for so long [ns]; it gets what `met` said last."""

    met: Callable[[], bool]
    patience_ns: int


Script = Generator[Until, bool, None]
Step = Generator[Until, bool, bool]


class Claim(NamedTuple):
    """A report that states progress: when it came and what it claims, plan times [ms]."""

    at_ms: int
    passed_ms: int
    report: Report


@dataclass
class Drive:
    """An epoch in which the robot drove, for the judge of its black box (track.py).

    `courses` by revision; `began_ns`: when GO was stated first; `stops`: from when to when [ns]
    STOP was stated; `claims`: the reports in GO and when they came.
    """

    epoch: int
    courses: list[Course]
    began_ns: int
    stops: list[tuple[int, int]] = field(default_factory=list)
    claims: list[tuple[int, Report]] = field(default_factory=list)


@dataclass
class Exam:
    """The stage, where the robot stands, and what was found so far.

    `place`: the robot's pose, as far as it is known; None: it does not say where it rests.
    `asks_person`: what a person is asked to do now, or nothing.  `first_start_ns`: the start of the
    first drive, from which black boxes count.
    """

    stage: Stage
    pace: Pace
    place: Pose | None = (0.0, 0.0, 0.0)
    failures: dict[str, list[str]] = field(default_factory=dict)
    tried: set[str] = field(default_factory=set)
    drives: list[Drive] = field(default_factory=list)
    asks_person: str = ""
    first_start_ns: int = 0
    _courses: dict[int, list[Course]] = field(default_factory=dict)
    _numbers: int = 10
    _start_changed_ns: int = 0

    def __post_init__(self) -> None:
        self.stage.on_report = self._look_at

    def judge(self, number: str, holds: bool, otherwise: str) -> None:
        """Record whether a requirement held this time, and what was seen if it did not."""
        assert number in REQUIREMENTS
        self.tried.add(number)
        seen = self.failures.setdefault(number, [])
        if not holds and otherwise not in seen:
            seen.append(otherwise)

    def next_number(self) -> int:
        """Return a number that no course has had."""
        self._numbers += 1
        return self._numbers

    def limit_pace(self) -> None:
        """Ask for no more than the robot's first Hello states, with a reserve for catching up."""
        hello = self.stage.hellos[0].message
        if isinstance(hello, Hello):
            speed = min(self.pace.speed, 0.8 * hello.max_speed_mps or self.pace.speed)
            accel = min(self.pace.accel, hello.max_accel_mps2 or self.pace.accel)
            self.pace = self.pace._replace(speed=speed, accel=accel)

    def new_course(
        self, pose: Pose, seconds: float, revision: int = 0, begin_ms: int = 0
    ) -> Course:
        """Return a course from a pose that takes about so long [s]."""
        stage = self.stage
        return course_from(
            pose,
            max(seconds * self.pace.speed, 0.2),
            self.pace,
            epoch=stage.epoch,
            boot=stage.boot,
            robot=stage.robot or "",
            number=self.next_number(),
            revision=revision,
            begin_ms=begin_ms,
        )

    def claims(self, since_ms: int = -(2**31)) -> list[Claim]:
        """Return what the reports of this epoch claim, from a plan time [ms] on."""
        stage, found = self.stage, []
        for heard in stage.reports:
            report = heard.message
            assert isinstance(report, Report)
            at_ms = (heard.at_ns - stage.start_ns) // MILLISECOND
            stamp = report.stamp_ms
            if report.epoch == stage.epoch and stamp is not None and at_ms >= since_ms:
                found.append(Claim(at_ms, stamp - LATE_STEP_MS * report.late, report))
        return found

    def phases(self, since_ms: int = -(2**31)) -> set[int]:
        """Return the phases that were reported from a plan time [ms] on."""
        stage = self.stage
        since_ns = stage.start_ns + since_ms * MILLISECOND
        found = [h.message for h in stage.reports if h.at_ns >= since_ns]
        return {one.phase for one in found if isinstance(one, Report)}

    def is_in(self, phase: int, revision: int | None = None) -> bool:
        """Return whether the robot reports a phase, in this epoch."""
        report = self.stage.report
        if report is None or report.epoch != self.stage.epoch or report.phase != phase:
            return False
        return revision is None or report.revision == revision

    def said_phase(self) -> str:
        """Return in words what the robot reported last."""
        report = self.stage.report
        if report is None or not self.stage.heard_within(SECOND):
            return "says nothing"
        fault = f", fault {report.fault}" if report.fault else ""
        return f"reports {PHASE_NAMES[report.phase]}{fault}"

    def goes_beyond(self, claim: Claim, course: Course, authority_ms: float) -> bool:
        """Return whether a claim on a course is of a place beyond its authority."""
        there = course.s_at(claim.passed_ms - ROUNDING_MS)
        return there > course.s_at(authority_ms) + SEEMS_M

    def pause(self, milliseconds: int) -> Script:
        """Let time pass."""
        yield Until(lambda: False, milliseconds * MILLISECOND)

    def until_ms(self, plan_ms: int) -> Script:
        """Let time pass until a plan time [ms]."""
        stage = self.stage
        yield Until(lambda: stage.plan_ms >= plan_ms, 60 * SECOND)

    def ready(self, seconds: float = 4.0) -> Step:
        """Bring the robot to rest, begin an epoch, and wait until it is armed; False if it fails.

        The plan takes about so long [s].
        """
        if not (yield from self.settle()):
            return False
        self.begin_epoch(seconds)
        armed = yield Until(lambda: self.is_in(ARMED), 6 * SECOND)
        if not armed and self.stage.form is plain:
            report = self.stage.report
            keeps = report is not None and report.epoch not in (0, self.stage.epoch)
            said = f"{self.said_phase()} with the plan of another epoch"
            self.judge("FREEZE-4" if keeps else "PLAN-4", False, said)
        return armed

    def settle(self) -> Step:
        """Bring the robot to rest where it is; False if it does not say where."""
        stage = self.stage
        report = stage.report
        if (
            not self._is_at_goal()
            and report is not None
            and (report.epoch or report.phase not in (IDLE, ARMED))
        ):
            stage.phase, stage.wanted, self.place = FREEZE, True, None
            told = yield Until(lambda: self._is_at_goal() or self._tells_rest(), 6 * SECOND)
            if not told and stage.heard_within(SECOND) and stage.form is plain:
                last = stage.report
                frozen = last is not None and last.phase == FROZEN
                self.judge("FREEZE-1", frozen, f"{self.said_phase()} 6 s after FREEZE")
                self.judge("FREEZE-2", not frozen, "does not say where it rests when asked")
        stage.wanted = False
        return self.place is not None

    def _is_at_goal(self) -> bool:
        """Take in that the robot is done; it may be so although it was told to freeze."""
        stage, report = self.stage, self.stage.report
        if report is None or not self.is_in(DONE) or not stage.plans:
            return False
        course = stage.plans[min(report.revision, len(stage.plans) - 1)]
        self.place = course.pose_at(course.curve.length)
        return True

    def _tells_rest(self) -> bool:
        """Take in where the robot rests, once it says so."""
        stage, report = self.stage, self.stage.report
        if report is None or report.phase != FROZEN:
            return False
        for heard in reversed(stage.reports[-20:]):
            one = heard.message
            now = isinstance(one, Report) and (one.epoch, one.phase) == (report.epoch, FROZEN)
            rest = one.rest if isinstance(one, Report) and now else None
            courses = self._courses.get(rest.epoch, []) if rest else []
            if rest and rest.revision < len(courses):
                self.place = courses[rest.revision].resting_pose(rest)
                return True
        return False

    def begin_epoch(self, seconds: float, place: Pose | None = None) -> Course:
        """State HOLD and a new epoch's plan, from where the robot is or from another place."""
        stage = self.stage
        stage.epoch += 1
        stage.phase, stage.held, stage.headroom_ms = HOLD, {}, PATIENCE_MS
        stage.first, stage.last, stage.speaks = 0, MOST_NUMBER, True
        pose = place or self.place
        assert pose is not None
        course = self.new_course(pose, seconds)
        stage.plans, stage.bad_plan = [course], None
        self._courses[stage.epoch] = stage.plans
        return course

    def go(self) -> None:
        """State GO, with a start soon."""
        stage = self.stage
        self.drives.append(Drive(stage.epoch, stage.plans, stage.now_ns))
        stage.phase = GO
        self.start_at(stage.now_ns + AHEAD)

    def start_at(self, start_ns: int) -> None:
        """State when the plan starts, or goes on."""
        stage = self.stage
        stage.start_ns, self._start_changed_ns = start_ns, stage.now_ns
        self.first_start_ns = self.first_start_ns or start_ns

    def arrives(self, by_ms: int, revision: int = 0) -> Step:
        """Wait until the robot is done, at most until a plan time [ms]."""
        stage = self.stage
        left_ns = (by_ms - stage.plan_ms) * MILLISECOND
        return (yield Until(lambda: self.is_in(DONE, revision), max(left_ns, MILLISECOND)))

    def plain(self) -> None:
        """Send messages as this version does again."""
        stage = self.stage
        stage.form, stage.twice, stage.clock_delay_ns, stage.answers = plain, False, 0, True

    def _look_at(self, report: Report) -> None:
        """Judge what every Report has to state."""
        stage = self.stage
        if self.drives and stage.phase == GO:
            self.drives[-1].claims.append((stage.reports[-1].at_ns, report))
        before = stage.reports[-2] if len(stage.reports) > 1 else None
        if before is not None and isinstance(before.message, Report):
            last = before.message
            if last.boot == report.boot:
                self.judge(
                    "REPORT-1",
                    report.sequence > last.sequence,
                    f"sequence {report.sequence} after {last.sequence}",
                )
                passed = (stage.reports[-1].at_ns - before.at_ns) / SECOND
                self.judge("REPORT-1", passed < 0.6, f"no Report for {passed:.1f} s")
        moves = report.phase in (MOVING, DONE)
        what = "states no stamp" if moves else "states a stamp"
        holds = moves == (report.stamp_ms is not None)
        self.judge("REPORT-2", holds, f"{what} in phase {PHASE_NAMES[report.phase]}")
        moves = report.phase not in (FROZEN, DONE, IDLE)
        self.judge(
            "WIRE-6",
            report.rest is None or not moves,
            f"says where it is in phase {PHASE_NAMES[report.phase]}",
        )
        self._look_at_stamp(report)

    def _look_at_stamp(self, report: Report) -> None:
        stage = self.stage
        at_ns = stage.reports[-1].at_ns
        if report.stamp_ms is None or report.epoch != stage.epoch or stage.phase != GO:
            return
        if at_ns - self._start_changed_ns < SECOND:
            return
        ahead_ms = report.stamp_ms - (at_ns - stage.start_ns) / MILLISECOND
        self.judge(
            "CLOCK-4",
            -1_000.0 < ahead_ms < CLOCK_MS + 5.0,
            f"a stamp is {abs(ahead_ms):.0f} ms {'ahead of' if ahead_ms > 0 else 'behind'} "
            "the plan time at which it came",
        )

    def look_at_hellos(self) -> None:
        """Judge the Hellos heard so far."""
        hellos = [h.message for h in self.stage.hellos if isinstance(h.message, Hello)]
        for one in hellos:
            self.judge("HELLO-1", one.version == 3, f"its version is {one.version}, not 3")
        boots = {one.boot for one in hellos}
        self.judge("HELLO-1", len(boots) == 1, "its boot id changes while it runs")
        counted = [one.sequence for one in hellos]
        rising = all(a < b for a, b in pairwise(counted))
        self.judge("HELLO-3", rising and 0 not in counted, f"its Hellos count {counted[:5]}")
        self.judge(
            "WIRE-6", all(one.place is None for one in hellos), "a Hello states a place in HOLD"
        )
