"""Rounding in the proof's kernels, for all inputs within bounds, and for the worst that are found.

The bounds are those of scenarios and plans: places within 8 km, plans of 20,000 s.
"""

from fractions import Fraction
from math import isqrt

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coordinator.proof.separation_kernels import nearest
from coordinator.scenario.margin import RESOLUTION
from tests.solver.rounding import Number, U, length, share

FAR = Fraction(8_000)
"""Greatest coordinate [m]."""

REACH = Fraction(100)
"""Robots that are farther apart than this [m] are not compared closely."""

SPARE = Fraction(RESOLUTION) / 1000
"""What rounding may take of the proof's resolution [m]."""

LONGEST = Fraction(20_000)
"""How long a plan may last [s]."""


def place():
    """`_part` and `_place`: X0 + (t - BEGIN) / (END - BEGIN) * (X1 - X0)."""
    begin, end = Number(FAR), Number(FAR)
    return (begin + share() * (end - begin)).within(FAR)


def distance():
    """The distance of two such places that are no farther apart than REACH."""
    along = (place() - place()).within(REACH)
    return length(along, along)


def test_a_place_on_a_piece_is_right_to_a_thousandth_of_the_resolution():
    assert place().error < SPARE


def test_a_distance_is_right_to_a_thousandth_of_the_resolution():
    assert distance().error < SPARE


def test_a_need_on_a_staircase_is_right_to_a_microsecond():
    """`need_at`: knots are whole milliseconds, whose differences are exact."""
    knot = Number(1000 * LONGEST)
    time = Number(1000 * LONGEST, U * 1000 * LONGEST)
    rise = (time - knot) * Number(Fraction(1), U)  # over a difference of at least 1 ms
    need = (knot + rise.within(1000 * LONGEST) * Number(1000 * LONGEST)).within(1000 * LONGEST)
    assert Number(LONGEST, need.error / (1000 * LONGEST) / 1000).error < Fraction(1, 10**6)


def test_the_bound_is_not_vacuous():
    """With numbers of 24 bits the same operations are too rough: the bound tells them apart."""
    assert (2**29) * distance().error > SPARE


def exactly(a, b, tau):
    """Return the square of the least distance of two pieces as `nearest` defines it, exactly.

    It is least where the places coincide, or on an edge of the allowed pairs of times.
    """
    a0, a1, ax, ay, cx, cy = map(Fraction, a[:6])
    b0, b1, bx, by, dx, dy = map(Fraction, b[:6])
    tau = Fraction(tau)
    u = ((cx - ax) / (a1 - a0), (cy - ay) / (a1 - a0))
    w = ((dx - bx) / (b1 - b0), (dy - by) / (b1 - b0))

    def square(t_a, t_b):
        x = ax + u[0] * (t_a - a0) - bx - w[0] * (t_b - b0)
        y = ay + u[1] * (t_a - a0) - by - w[1] * (t_b - b0)
        return x * x + y * y, x, y

    found = []
    for t in (a0, a1):
        low, high = max(b0, t - tau), min(b1, t + tau)
        if low <= high:
            found.append(_on_edge(square, (t, low), (t, high), (-w[0], -w[1])))
    for t in (b0, b1):
        low, high = max(a0, t - tau), min(a1, t + tau)
        if low <= high:
            found.append(_on_edge(square, (low, t), (high, t), u))
    for shift in (-tau, tau):
        low, high = max(a0, b0 - shift), min(a1, b1 - shift)
        if low <= high:
            ends = (low, low + shift), (high, high + shift)
            found.append(_on_edge(square, *ends, (u[0] - w[0], u[1] - w[1])))
    turn = u[0] * w[1] - u[1] * w[0]
    if turn != 0:
        x, y = bx - ax, by - ay
        t_a, t_b = a0 + (x * w[1] - y * w[0]) / turn, b0 + (x * u[1] - y * u[0]) / turn
        if a0 <= t_a <= a1 and b0 <= t_b <= b1 and abs(t_a - t_b) <= tau:
            found.append(Fraction(0))
    return min(found, default=None)


def _on_edge(square, begin, end, rate):
    """Return the least square along an edge, on which the vector changes by `rate` [m/s]."""
    _, x, y = square(*begin)
    speed = rate[0] ** 2 + rate[1] ** 2
    most = max(end[0] - begin[0], end[1] - begin[1])
    k = Fraction(0) if speed == 0 else min(max(-(x * rate[0] + y * rate[1]) / speed, 0), most)
    x, y = x + k * rate[0], y + k * rate[1]
    return x * x + y * y


coordinates = st.floats(-8000.0, 8000.0)
tiny = st.floats(-1e-6, 1e-6)


@st.composite
def pieces(draw):
    """Two pieces near each other: any, or almost parallel, almost still, almost touching."""
    x, y, begin = draw(coordinates), draw(coordinates), draw(st.floats(0.0, 80_000.0))
    lasts = st.floats(1e-3, 100.0)
    length = st.floats(-50.0, 50.0) | tiny | st.just(0.0)
    dx, dy = draw(length), draw(length)
    a = [begin, begin + draw(lasts), x, y, x + dx, y + dy]
    share_of = draw(st.floats(-2.0, 2.0))
    ex, ey = (dx * share_of + draw(tiny), dy * share_of + draw(tiny))
    if draw(st.booleans()):
        ex, ey = draw(length), draw(length)
    from_x, from_y = x + draw(length), y + draw(length)
    since = begin + draw(st.floats(-5.0, 5.0))
    b = [since, since + draw(lasts), from_x, from_y, from_x + ex, from_y + ey]
    return np.array([*a, 0.0]), np.array([*b, 0.0]), draw(st.floats(0.0, 3.0))


@settings(max_examples=400, deadline=None)
@given(pieces())
@example(
    (
        np.array([0.0, 10.0, 8000.0, 8000.0, 8010.0, 8000.0, 0.0]),
        np.array([0.0, 10.0, 8000.0, 8000.0 - 5e-9, 8010.0, 8000.0 + 5e-9, 0.0]),
        0.5,
    )
)
def test_the_nearest_places_of_two_pieces_are_as_near_as_exact_numbers_say(case):
    """Near a crossing at an angle d, rounding takes at most e / d off a place, and an edge is
    never farther than the length times d: the lesser of both is small for every d."""
    a, b, tau = case
    least, found = exactly(a, b, tau), nearest(a, b, tau).distance
    if least is None:
        assert found == np.inf
        return
    exact = Fraction(isqrt(int(least * 10**40)), 10**20)
    assert abs(Fraction(found) - exact) < Fraction(1, 10**5)


def test_kernels_compute_in_double_precision():
    assert np.finfo(np.float64).eps == float(2 * U)
