"""Judges where the robot truly was, by its black box: no message says so.

Decides: which requirements the true places break.  Must not know: files.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from coordinator.conformance.courses import TRACK_MM, Course
from coordinator.conformance.exam import Drive, Exam
from protocol.phases import GO
from protocol.timing import LATE_STEP_MS, SECOND

Row = tuple[float, float, float]
"""t [s since the first start, on the coordinator's clock], x, y [m]."""

TOLERANCE_M: Final = TRACK_MM / 1000.0 + 0.005
"""The track tolerance, and 5 mm for the clock by which the rows are stamped."""

_LEAST_S: Final = 0.04
"""Rows that follow sooner than this [s] are left out."""

_STEP_M: Final = 0.005
_REACH_M: Final = 0.08
_STILL_M: Final = 0.01


@dataclass(frozen=True)
class _Seen:
    """Where the robot was at a time [ns]: `s` on the course of a revision, `off` [m] beside it."""

    at_ns: int
    revision: int
    s: float
    off: float
    x: float
    y: float


def judge_track(exam: Exam, rows: Sequence[Row]) -> None:
    """Judge GO-3, AUTH-1, LATE-1 and STOP-1 by the true places."""
    ends = [*(drive.began_ns for drive in exam.drives[1:]), 2**62]
    for drive, end_ns in zip(exam.drives, ends, strict=False):  # Without drives, one end is left.
        seen = _follow(drive, _rows_within(exam, rows, drive.began_ns, end_ns))
        if len(seen) > 1:
            _judge_path(exam, seen)
            _judge_authority(exam, drive, seen)
            _judge_claims(exam, drive, seen)
            _judge_stops(exam, drive, seen)


def _rows_within(exam: Exam, rows: Sequence[Row], begin_ns: int, end_ns: int) -> list[Row]:
    """Return the rows of a drive, with times on the played coordinator's clock [ns]."""
    found: list[Row] = []
    last = -math.inf
    for t, x, y in rows:
        at_ns = exam.first_start_ns + round(t * SECOND)
        if begin_ns <= at_ns < end_ns and t - last >= _LEAST_S:
            found.append((at_ns, x, y))
            last = t
    return found


def _follow(drive: Drive, rows: Sequence[Row]) -> list[_Seen]:
    """Follow the robot along its courses: its arc length is looked for near the last one."""
    seen: list[_Seen] = []
    revision, s = 0, 0.0
    last_x, last_y = rows[0][1:] if rows else (0.0, 0.0)
    for at_ns, x, y in rows:
        reported = _revision_at(drive, round(at_ns))
        if reported != revision:
            revision, s = reported, 0.0
        reach = _REACH_M + 2.0 * math.hypot(x - last_x, y - last_y)
        last_x, last_y = x, y
        s, off = _nearest(drive.courses[revision], s, x, y, reach)
        seen.append(_Seen(round(at_ns), revision, s, off, x, y))
    return seen


def _revision_at(drive: Drive, at_ns: int) -> int:
    """Return the revision that the robot drove, by its last report before a time."""
    before = [report.revision for heard_ns, report in drive.claims if heard_ns <= at_ns]
    return min(before[-1], len(drive.courses) - 1) if before else 0


def _nearest(course: Course, s: float, x: float, y: float, reach: float) -> tuple[float, float]:
    """Return the arc length within reach [m] of s that is nearest to a place, and how far [m]."""

    def apart(at: float) -> float:
        there_x, there_y, _ = course.pose_at(at)
        return math.hypot(there_x - x, there_y - y)

    length, step = course.curve.length, _STEP_M
    count = round(reach / step)
    near = [min(max(s + step * i, 0.0), length) for i in range(-count // 4, count + 1)]
    best = min(near, key=apart)
    while step > 1e-4:
        step *= 0.5
        best = min((max(best - step, 0.0), best, min(best + step, length)), key=apart)
    return best, apart(best)


def _judge_path(exam: Exam, seen: Sequence[_Seen]) -> None:
    worst = max(seen, key=lambda one: one.off)
    text = f"its black box has it {1000.0 * worst.off:.0f} mm off its path"
    exam.judge("GO-3", worst.off <= TOLERANCE_M, text)


def _judge_authority(exam: Exam, drive: Drive, seen: Sequence[_Seen]) -> None:
    commands = [
        told
        for told in exam.stage.said
        if told.command.epoch == drive.epoch and told.command.phase == GO
    ]
    granted: dict[int, int] = {}
    place, worst = 0, -math.inf
    for one in seen:
        while place < len(commands) and commands[place].at_ns <= one.at_ns:
            for course in drive.courses:
                said = commands[place].command.authority_of(course.plan.number)
                if said is not None:
                    granted[course.plan.number] = max(granted.get(course.plan.number, 0), said)
            place += 1
        course = drive.courses[one.revision]
        worst = max(worst, one.s - course.s_at(granted.get(course.plan.number, 0)))
    text = f"its black box has it {1000.0 * worst:.0f} mm beyond its authority"
    exam.judge("AUTH-1", worst <= TOLERANCE_M, text)


def _judge_claims(exam: Exam, drive: Drive, seen: Sequence[_Seen]) -> None:
    """Judge that the robot was, when a report came, at least as far as the report claims."""
    place, worst = 0, -math.inf
    for at_ns, report in drive.claims:
        while place < len(seen) - 1 and seen[place].at_ns < at_ns:
            place += 1
        one = seen[place]
        if one.at_ns < at_ns or report.stamp_ms is None or report.revision != one.revision:
            continue
        passed = report.stamp_ms - LATE_STEP_MS * report.late
        worst = max(worst, drive.courses[one.revision].s_at(passed) - one.s)
    text = f"claims to be {1000.0 * worst:.0f} mm farther than its black box has it"
    exam.judge("LATE-1", worst <= TOLERANCE_M, text)


def _judge_stops(exam: Exam, drive: Drive, seen: Sequence[_Seen]) -> None:
    braking_ns = round((exam.pace.speed / exam.pace.accel + 0.3) * SECOND)
    for begin_ns, end_ns in drive.stops:
        still = [one for one in seen if begin_ns + braking_ns <= one.at_ns < end_ns]
        moved = max((math.hypot(a.x - still[0].x, a.y - still[0].y) for a in still), default=0.0)
        text = f"its black box has it move by {1000.0 * moved:.0f} mm long after STOP"
        exam.judge("STOP-1", moved <= _STILL_M, text)
