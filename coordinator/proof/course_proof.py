"""The proof of a robot's new course among the courses of all others, from its wire bytes.

The course is compared with every course that another robot may be driving, at the plan times at
which both may still be driven.  All that was proven before stays as it is.

Decides: whether a new course may leave the coordinator.  Must not know: how it was found.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from coordinator.plan.course import Boxes, Course
from coordinator.plan.document import Limits
from coordinator.plan.staircases import Staircases
from coordinator.plan.wire import Driven
from coordinator.proof.limits import limit_failures
from coordinator.proof.motion_pieces import Flights, Part
from coordinator.proof.precedence import staircase_failures
from coordinator.proof.shared_course import shared_until
from coordinator.proof.tau_safety import Gap, clearances, separation_failures
from coordinator.scenario.margin import TOLERANCE


def course_failures(
    courses: Sequence[Course],
    staircases: Staircases,
    margin: float,
    limits: Limits,
    gap: Gap,
    before: Driven | None = None,
) -> list[str]:
    """Return what is wrong with the first of these courses among the others; margin [m].

    `staircases` are those of the first course with the others, by their indices.  `gap` returns the
    distance [m] from a polyline to the nearest solid thing.  `before`: the course that the robot
    drives; one that does not begin at rest has to run along it for a while.
    """
    mine = courses[0].driven
    leads_on = before is not None and shared_until(before, mine) > 0.001 * mine.plan.begin_ms
    failures = limit_failures(mine, limits, from_rest=not leads_on)
    (clearance,) = clearances([mine], gap)
    if clearance < margin - TOLERANCE:
        failures.append(f"{mine.id} comes within {clearance:.4f} m of something solid")
    return failures + pair_failures(courses, staircases, margin)


def pair_failures(courses: Sequence[Course], staircases: Staircases, margin: float) -> list[str]:
    """Return where the first of these courses comes too near to others, or is not held in time.

    The same as in `course_failures`, which says what else is wrong with it.
    """
    if len(courses) < 2:
        return []
    driven = [one.driven for one in courses]
    part = Part([(one.since, one.until) for one in courses], [k == 0 for k in range(len(courses))])
    flights = Flights(driven, part)
    failures = separation_failures(flights, staircases.tau_ms / 1000.0, margin)
    return failures + staircase_failures(flights, staircases, margin)


def that_may_meet(course: Course, others: Sequence[Course], margin: float) -> list[Course]:
    """Return the other courses whose boxes come as near as matters to a course."""
    mine, boxes = course.driven, Boxes(others)
    apart = boxes.apart(mine.chain.points) - mine.chain.bound
    near = apart < mine.radius + boxes.radii + margin
    return [others[k] for k in np.flatnonzero(near).tolist()]
