"""The invariant of authority over one step of each kind, for one ordered pair and its mirror image.

Robot j is behind robot i.  A staircase is any function that never falls; that is said for the plan
times that occur, since a function on a few times that does not fall there can be drawn on.  The
invariant need(A of one course) < P of another course is about two courses of two robots, so two
robots, each with a course in force and a newer one, are all that a step is about.
"""

from __future__ import annotations

from itertools import combinations

import pytest
import z3

from tests.solver.proving import is_proven, without

A_J, A_I, P_I, P_J, TRUE_I, TRUE_J = z3.Reals("A_j A_i P_i P_j p_i p_j")
OLD = z3.Function("need_ij", z3.RealSort(), z3.RealSort())
BEHIND = z3.Function("need_of_newer", z3.RealSort(), z3.RealSort())
AHEAD = z3.Function("need_for_newer", z3.RealSort(), z3.RealSort())
BEGIN, SHARED = z3.Reals("b e")


def never_falls(staircase, *times):
    """Say that a staircase does not fall among these plan times."""
    return z3.And(
        *(
            z3.And(
                z3.Implies(one <= other, staircase(one) <= staircase(other)),
                z3.Implies(other <= one, staircase(other) <= staircase(one)),
            )
            for one, other in combinations(times, 2)
        )
    )


def lesser(one, other):
    """Return the lesser of two numbers."""
    return z3.If(one < other, one, other)


def greater(one, other):
    """Return the greater of two numbers."""
    return z3.If(one < other, other, one)


HOLDS = {
    "invariant": OLD(A_J) < P_I,
    "P_i is passed": P_I <= TRUE_I,
    "j keeps to its authority": TRUE_J <= A_J,
}
"""What holds before a step."""


def nobody_touches():
    """Where the robots are, (p_i, p_j), is no conflict with i behind in plan time."""
    conflict = z3.Bool("conflict")
    covers = z3.Implies(z3.And(conflict, TRUE_I < TRUE_J), OLD(TRUE_J) >= TRUE_I)
    premises = {**HOLDS, "covers": covers, "never falls": never_falls(OLD, A_J, TRUE_J)}
    return premises, z3.Not(z3.And(conflict, TRUE_I < TRUE_J))


def a_report():
    """A report raises P_i to what it claims, and claims no more than was made."""
    claimed = z3.Real("claimed")
    after = greater(P_I, claimed)
    premises = {**HOLDS, "claims no more than was made": claimed <= TRUE_I}
    return premises, z3.And(OLD(A_J) < after, after <= TRUE_I)


def a_grant():
    """A grant raises A_j to a plan time by the rule; what is not by the rule is not granted."""
    granted, after = z3.Real("granted"), z3.Real("A_j after")
    premises = {
        **HOLDS,
        "rule": z3.Or(granted <= A_J, OLD(granted) < P_I),
        "only grows": after == greater(A_J, granted),
    }
    return premises, z3.And(OLD(after) < P_I, after >= TRUE_J)


def a_commit():
    """A newer course of j: need(A'_j) < P_i, and need(A_i) < P'_j, at once."""
    told, known = z3.Reals("A'_j P'_j")
    premises = {
        "A' begins so": told == greater(BEGIN, lesser(A_J, SHARED)),
        "P' begins so": known == lesser(P_J, SHARED),
        "P_j is passed": P_J <= TRUE_J,
        "allows what j may be told": BEHIND(greater(BEGIN, lesser(A_J, SHARED))) < P_I,
        "allows what i was told": AHEAD(A_I) < lesser(P_J, SHARED),
        "shared": BEGIN <= SHARED,
    }
    return premises, z3.And(BEHIND(told) < P_I, AHEAD(A_I) < known)


def a_change():
    """A robot that has changed to its newer course has passed P'_j of it, and not A'_j."""
    told, known, newer = z3.Reals("A'_j P'_j p'_j")
    premises = {
        "P' begins so": known == lesser(P_J, SHARED),
        "A' begins so": told == greater(BEGIN, lesser(A_J, SHARED)),
        "P_j is passed": P_J <= TRUE_J,
        "j keeps to its authority": z3.Or(newer == BEGIN, newer <= A_J),
        "changes where both are the same": z3.And(newer >= BEGIN, newer <= SHARED),
        "keeps its plan time": z3.Or(newer == TRUE_J, z3.And(newer == BEGIN, TRUE_J <= BEGIN)),
    }
    return premises, z3.And(known <= newer, newer <= told)


def a_confirmation():
    """A report of the newer course raises P'_j to where that begins; the old one counts no more."""
    known, newer = z3.Reals("P'_j p'_j")
    after = greater(known, BEGIN)
    premises = {
        "invariant": AHEAD(A_I) < known,
        "P' is passed": known <= newer,
        "drives the newer one": newer >= BEGIN,
    }
    return premises, z3.And(AHEAD(A_I) < after, after <= newer)


def a_take_over():
    """The next coordinator counts on what the log says ahead, and commits by that."""
    logged, known = z3.Reals("ahead P'_j")
    premises = {
        "logged before it is told": logged >= A_I,
        "allows what i may have been told": AHEAD(logged) < known,
        "never falls": never_falls(AHEAD, A_I, logged),
    }
    return premises, AHEAD(A_I) < known


NEEDED = {
    nobody_touches: (
        "invariant",
        "P_i is passed",
        "j keeps to its authority",
        "covers",
        "never falls",
    ),
    a_report: ("invariant", "P_i is passed", "claims no more than was made"),
    a_grant: ("invariant", "rule", "j keeps to its authority", "only grows"),
    a_commit: (
        "allows what j may be told",
        "allows what i was told",
        "A' begins so",
        "P' begins so",
    ),
    a_change: ("P_j is passed", "j keeps to its authority", "changes where both are the same"),
    a_confirmation: ("invariant", "P' is passed", "drives the newer one"),
    a_take_over: (
        "logged before it is told",
        "allows what i may have been told",
        "never falls",
    ),
}
"""Each kind of step, and premises without which it breaks."""


@pytest.mark.parametrize("step", NEEDED, ids=lambda step: step.__name__)
def test_the_invariant_holds_after_a_step_of_each_kind(step):
    assert is_proven(*step())


@pytest.mark.parametrize(
    ("step", "premise"), [(step, name) for step, names in NEEDED.items() for name in names]
)
def test_without_a_premise_a_step_breaks_it(step, premise):
    premises, claim = step()
    assert not is_proven(without(premises, premise), claim)
