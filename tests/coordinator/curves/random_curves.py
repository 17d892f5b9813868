"""Curves to try things on."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from coordinator.curves.nurbs import nurbs


def random_curve(seed, degree=3, count=9, weighted=True, doubled=False):
    """A curve from left to right over u in [0, 10]."""
    random = np.random.default_rng(seed)
    inner = np.sort(random.uniform(0.5, 9.5, count - degree - 1))
    if doubled and len(inner) > 1:
        inner[1] = inner[0]
    knots = np.concatenate((np.zeros(degree + 1), inner, np.full(degree + 1, 10.0)))
    points = np.column_stack((np.linspace(0.0, 8.0, count), random.uniform(0.0, 4.0, count)))
    weights = random.uniform(0.4, 2.5, count) if weighted else np.ones(count)
    return nurbs(degree, knots, points, weights)


@st.composite
def any_curves(draw):
    """Degrees 1 to 9, knots up to as often as the degree, weighted or not, any shape."""
    degree = draw(st.integers(1, 9))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    places = np.sort(random.uniform(0.3, 9.7, draw(st.integers(0, 4))))
    inner = np.repeat(places, [random.integers(1, degree + 1) for _ in places])
    count = len(inner) + degree + 1
    knots = np.concatenate((np.zeros(degree + 1), inner, np.full(degree + 1, 10.0)))
    weights = random.uniform(0.2, 5.0, count) if draw(st.booleans()) else np.ones(count)
    return nurbs(degree, knots, random.uniform(-5.0, 5.0, (count, 2)), weights)


def quarter_circle():
    half = math.sqrt(0.5)
    return nurbs(2, [0, 0, 0, 1, 1, 1], [[1, 0], [1, 1], [0, 1]], [1.0, half, 1.0])


def full_circle():
    """The unit circle from (1, 0), counter-clockwise, of 9 points (The NURBS Book, Ex. 7.2)."""
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    points = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]
    return nurbs(2, knots, points, [1.0 if i % 2 == 0 else math.sqrt(0.5) for i in range(9)])


def a_smooth_path():
    """A spline as smoothing makes them: knots by arc length, corners of unlike widths."""
    knots = [0, 0, 0, 0, 1.2, 1.5, 1.8, 4.0, 4.002, 4.004, 7, 7, 7, 7]
    greville = [sum(knots[i + 1 : i + 4]) / 3 for i in range(len(knots) - 4)]
    arc, corners = [0.0, 1.5, 4.002, 7.0], [[0, 0], [1.5, 0], [1.5, 2.502], [4.3, 1.431]]
    points = [[np.interp(g, arc, [c[axis] for c in corners]) for axis in (0, 1)] for g in greville]
    return nurbs(3, knots, points)
