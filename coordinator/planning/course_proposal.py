"""A new course for one robot among the courses of all others, found and proven.

The others keep their courses: the robot waits for them, or goes ahead of them where that holds up
nobody.  On a floor where every place that robots rest at leaves the others a way there is always
such a course: at the latest, when all others rest (Cap, Vokrinek and Kleiner 2015).

Decides: what is proposed for a wish, and that it is proven.  Must not know: how the course is
found, why it is wanted, clocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from msgspec.structs import replace as changed

from coordinator.base.errors import PlanError
from coordinator.plan.course import Course
from coordinator.plan.course_staircases import joined
from coordinator.plan.document import Limits, PlanDocument
from coordinator.plan.drafting import rounded
from coordinator.plan.staircases import Staircases
from coordinator.plan.wire import Driven, pack, unpack
from coordinator.planning.earliest_course import Search, earliest
from coordinator.planning.wish import Site, Wish
from coordinator.proof.course_proof import course_failures, pair_failures, that_may_meet
from coordinator.schedule.staircase_making import STANDOFF, staircases_among


@dataclass(frozen=True, eq=False)
class Proposal:
    """A course: its message with boot id 0, and its staircases with the courses `near`.

    In `staircases` the course has index 0, that of near[k] is k + 1.
    """

    course: Course
    message: bytes
    near: list[Course]
    staircases: Staircases


def propose(site: Site, wish: Wish, others: Sequence[Course]) -> Proposal:
    """Return the earliest course that fulfils a wish; raises PlanError where there is none."""
    robot, terms = wish.robot, site.terms
    search = Search(site, wish, others)
    found = earliest(search)
    names = [robot.id, *(one.driven.id for one in found.near)]
    try:
        plan = rounded(robot, found.path, found.motion, names)
        if wish.leaves is not None:
            plan = changed(plan, start_time=0.0)  # It does not rest where the course begins.
        message = pack(terms, plan, wish.number, wish.revision, wish.begin_ms)
        driven = unpack(message, robot.radius)
    except ValueError as error:
        reason, helps = f"has a way that cannot be sent: {error}", "fewer places to pass"
        raise PlanError(reason, robot.id, helps=helps if robot.via else "") from None
    if objection := wish.holds.objection(message):
        raise PlanError(objection, robot.id)
    proposal = _among(driven, message, site, others)
    courses = [proposal.course, *proposal.near]
    before = None if wish.leaves is None else wish.leaves.driven
    failures = course_failures(
        courses, proposal.staircases, terms.margin, Limits.of(robot), site.gap, before
    )
    if wish.leaves is not None and not wish.leaves.is_shared_by(proposal.course.driven):
        failures.append(f"{robot.id} leaves its course too soon")
    if failures:
        raise PlanError(
            "the course found does not pass its proof: " + "; ".join(failures), robot.id
        )
    return proposal


def proposal_of(message: bytes, site: Site, wish: Wish, others: Sequence[Course]) -> Proposal:
    """Return the course that a message states, with its staircases; not proven here.

    Raises ValueError if a robot would refuse the message.
    """
    return _among(unpack(message, wish.robot.radius), message, site, others)


def _among(driven: Driven, message: bytes, site: Site, others: Sequence[Course]) -> Proposal:
    course = Course(driven, 0.001 * driven.plan.begin_ms)
    near = that_may_meet(course, others, site.terms.margin + STANDOFF)
    return Proposal(course, message, near, staircases_among(course, near, site.terms))


def among_further(
    proposal: Proposal, further: Sequence[Course], terms: PlanDocument
) -> Proposal | None:
    """Return a proven proposal among further courses, proven; None if it comes too near to one."""
    near = that_may_meet(proposal.course, further, terms.margin + STANDOFF)
    if not near:
        return proposal
    found = staircases_among(proposal.course, near, terms)
    if pair_failures([proposal.course, *near], found, terms.margin):
        return None
    both = joined(proposal.staircases, found, len(proposal.near))
    return replace(proposal, near=[*proposal.near, *near], staircases=both)
