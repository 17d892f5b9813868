"""The closed forms that kernels and robots compute by, against their definitions over the reals."""

from __future__ import annotations

import pytest
import z3

from tests.solver.proving import is_proven, without

X, Y, K, MOST = z3.Reals("x y k most")
VAX, VAY, VBX, VBY = z3.Reals("vax vay vbx vby")


def nearest_on_an_edge():
    """`_nearer`: the distance (x + k dx, y + k dy) is least at k* among all 0 <= k <= most."""
    dx, dy, best = z3.Reals("dx dy best")
    square, ahead = dx * dx + dy * dy, -(X * dx + Y * dy)
    inside = z3.If(ahead > MOST * square, best == MOST, best * square == ahead)
    premises = {
        "moves": square > 0,
        "clipped": z3.If(ahead < 0, best == 0, inside),
        "from 0": K >= 0,
        "to most": z3.And(K <= MOST, MOST >= 0),
    }

    def far(k):
        return (X + k * dx) * (X + k * dx) + (Y + k * dy) * (Y + k * dy)

    return premises, far(best) <= far(K)


def zero_inside():
    """`nearest`: where neither time lessens the distance and directions differ, it is 0."""
    premises = {
        "not by the time of a": X * VAX + Y * VAY == 0,
        "not by the time of b": X * VBX + Y * VBY == 0,
        "directions differ": VAX * VBY - VAY * VBX != 0,
    }
    return premises, z3.And(X == 0, Y == 0)


def along_to_an_edge():
    """`nearest`: with one direction, both times can go on to an edge and the distance stays."""
    is_still = z3.And(VAX == 0, VAY == 0)
    ux, uy = z3.If(is_still, VBX, VAX), z3.If(is_still, VBY, VAY)
    by_a, by_b = VBX * ux + VBY * uy, VAX * ux + VAY * uy
    premises = {"one direction": VAX * VBY - VAY * VBX == 0}
    return premises, z3.And(by_a * VAX - by_b * VBX == 0, by_a * VAY - by_b * VBY == 0)


V, B, WAY, REACTION = z3.Reals("v b way reaction")


def brakes_in_time():
    """`Ride._within_authority`: after the reaction and v / b of braking the robot is not beyond."""
    root = z3.Real("root")
    lost = B * REACTION
    premises = {
        "brakes": B > 0,
        "reacts": REACTION > 0,
        "a way is left": WAY >= 0,
        "root": z3.And(root >= 0, root * root == lost * lost + 2 * B * WAY),
        "no faster": z3.And(V >= 0, root - lost >= V),
    }
    return premises, 2 * B * V * REACTION + V * V <= 2 * B * WAY


def braking_distance():
    """While it brakes with b from v, a robot goes v t - b t^2 / 2, at most v^2 / 2 b."""
    t = z3.Real("t")
    premises = {"brakes": B > 0}
    return premises, 2 * B * (V * t) - B * B * t * t <= V * V


V0, V1, LENGTH, T, RATE = z3.Reals("v0 v1 length t a")


def leg_of_a_profile():
    """`Timeline`: v^2 linear in s over a leg is a constant rate for 2 length / (v0 + v1)."""
    premises = {
        "has length": LENGTH > 0,
        "rate": 2 * LENGTH * RATE == V1 * V1 - V0 * V0,
        "time": T * (V0 + V1) == 2 * LENGTH,
    }
    return premises, z3.And(V0 + RATE * T == V1, 2 * V0 * T + RATE * T * T == 2 * LENGTH)


AT, BEGIN, LOW, RISE, WIDE, KNOWN, LIMIT = z3.Ints("at begin low rise wide known limit")


def least_above(over):
    """Say that limit - begin is the whole part of ((known - low) wide - 1) / rise."""
    left = (KNOWN - LOW) * WIDE - 1
    return z3.And((LIMIT - BEGIN) * over <= left, left < (LIMIT - BEGIN + 1) * over)


def within_a_staircase():
    """`_limit`: up to the limit, and no further, a rising piece needs less than is known passed."""
    premises = {
        "rises": RISE > 0,
        "limit": least_above(RISE),
    }
    needs_less = RISE * (AT - BEGIN) < (KNOWN - LOW) * WIDE
    return premises, needs_less == (AT <= LIMIT)


def within_tau():
    """`_limit`: what is tau or more before a plan time is all that it can need."""
    tau, need = z3.Ints("tau need")
    premises = {
        "before tau": need <= AT - tau,
        "limit": KNOWN + tau - 1 >= AT,
    }
    return premises, need < KNOWN


FORMS = {
    nearest_on_an_edge: ("clipped", "to most"),
    zero_inside: ("directions differ", "not by the time of a", "not by the time of b"),
    along_to_an_edge: ("one direction",),
    brakes_in_time: ("no faster", "root"),
    braking_distance: (),
    leg_of_a_profile: ("has length", "rate", "time"),
    within_a_staircase: ("limit",),
    within_tau: ("before tau", "limit"),
}
"""Each closed form, and premises without which it is wrong."""


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.__name__)
def test_a_closed_form_is_its_definition(form):
    assert is_proven(*form())


@pytest.mark.parametrize(
    ("form", "premise"), [(form, name) for form, names in FORMS.items() for name in names]
)
def test_without_a_premise_a_closed_form_is_refuted(form, premise):
    premises, claim = form()
    assert not is_proven(without(premises, premise), claim)


def test_a_braking_distance_of_half_the_size_is_refuted():
    t = z3.Real("t")
    assert not is_proven({"brakes": B > 0}, 4 * B * (V * t) - 2 * B * B * t * t <= V * V)
