"""The proof of all that is in force in a fleet, before a coordinator goes on with it.

Every course that a robot may be driving is proven from its bytes: its limits, its clearance, and
with all others tau-safety and the staircases by which authority is granted.  Courses count from
where their robots are known to be: what was passed is proven no more.

Decides: what has to hold to go on.  Must not know: logs, files.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from coordinator.mission.mission import Mission
from coordinator.plan.course import Course
from coordinator.plan.course_staircases import CourseStaircases
from coordinator.plan.document import Limits
from coordinator.plan.staircases import Staircases
from coordinator.plan.wire import Driven
from coordinator.proof.limits import limit_failures
from coordinator.proof.motion_pieces import Flights, Part
from coordinator.proof.precedence import staircase_failures
from coordinator.proof.shared_course import shared_until
from coordinator.proof.tau_safety import clearances, separation_failures
from coordinator.scenario.margin import TOLERANCE


def in_force_failures(mission: Mission) -> list[str]:
    """Return what is wrong with the courses in force, in sentences."""
    site = mission.dispatcher.obstructions.site
    courses, staircases = mission.fleet.grants.in_force()
    if site is None or not courses:
        return []
    margin, robots = site.terms.margin, mission.dispatcher.robots
    driven = [one.driven for one in courses]
    failures = []
    before: dict[str, Driven] = {}
    for one, clearance in zip(driven, clearances(driven, site.gap), strict=True):
        old, before[one.id] = before.get(one.id), one
        from_rest = one.plan.revision == 0
        if old is not None:
            from_rest = shared_until(old, one) <= 0.001 * one.plan.begin_ms
        failures += limit_failures(one, Limits.of(robots[one.id]), from_rest=from_rest)
        if clearance < margin - TOLERANCE:
            failures.append(f"{one.id} comes within {clearance:.4f} m of something solid")
    return [*failures, *_too_near(courses, staircases, site.terms.tau, margin)]


def _too_near(
    courses: Sequence[Course], staircases: Staircases, tau: float, margin: float
) -> list[str]:
    """Return what is wrong among the courses; those of one robot are not compared."""
    first: dict[str, int] = {}
    for k, course in enumerate(courses):
        first.setdefault(course.driven.id, k)
    table = CourseStaircases(staircases)
    now, failures = list(first.values()), []
    parts = [(now, [True] * len(now))]
    for k in sorted(set(range(len(courses))) - set(now)):
        others = [j for j, one in enumerate(courses) if one.driven.id != courses[k].driven.id]
        parts.append(([k, *others], [True, *(False for _ in others)]))
    for which, asked in parts:
        driven = [courses[k].driven for k in which]
        part = Part([(courses[k].since, math.inf) for k in which], asked)
        flights = Flights(driven, part)
        failures += separation_failures(flights, tau, margin)
        failures += staircase_failures(flights, table.among(which), margin)
    return failures
