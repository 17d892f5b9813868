"""All intersections: against polylines and shapely, and on curves whose meetings are known."""

import itertools
import math

import numpy as np
import pytest
import shapely

from coordinator.curves.intersections import find_all_intersections
from coordinator.curves.knots import piece, refine
from coordinator.curves.nurbs import Nurbs, nurbs
from tests.oracle_polylines import differences, place, polyline_crossings
from tests.sweeps import seeds

PAIRS = 80
"""Random pairs; benchmarks.intersections.against_polylines looks at 10,000."""
CHORDS, FINE = 100, 3000
"""Chords a span of the polylines, and of those that are asked where the coarse ones differ."""


def random_curve(random, degree, count, *, wild=False, size=10.0):
    weights = np.exp(random.uniform(-2.0, 2.0, count)) if wild else np.ones(count)
    inner = np.arange(1.0, count - degree)
    knots = np.concatenate((np.zeros(degree + 1), inner, np.full(degree + 1, len(inner) + 1.0)))
    return nurbs(degree, knots, random.uniform(0.0, size, (count, 2)), weights)


def random_pair(seed):
    """Two curves of any degree with up to 11 control points, half of them with weights."""
    random = np.random.default_rng(seed)
    pair = []
    for _ in range(2):
        degree = int(random.integers(1, 8))
        count = int(random.integers(degree + 1, 12))
        pair.append(random_curve(random, degree, count, wild=bool(random.random() < 0.5)))
    return pair


def cubic(*points):
    count = len(points)
    inner = np.arange(1.0, count - 3)
    knots = np.concatenate((np.zeros(4), inner, np.full(4, count - 3.0)))
    return nurbs(3, knots, points)


def line(*points):
    inner = np.arange(1.0, len(points) - 1)
    return nurbs(1, np.concatenate(([0, 0], inner, np.full(2, len(points) - 1.0))), points)


def circle(x, y, radius):
    """Four quarters of a circle, from the right, counter-clockwise."""
    corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    weights = [1, math.sqrt(0.5)] * 4 + [1]
    return nurbs(2, knots, np.array(corners) * radius + (x, y), weights)


def moved(curve, x, y):
    return Nurbs(curve.degree, curve.knots, curve.points + np.array((x, y)), curve.weights)


def backwards(curve):
    knots = curve.knots[-1] - curve.knots[::-1]
    return Nurbs(curve.degree, knots, curve.points[::-1].copy(), curve.weights[::-1].copy())


def find_intersections(a, b, tolerance=1e-9):
    return find_all_intersections([a, b], [(0, 1)], tolerance)[0]


def find_self_intersections(curve):
    return find_all_intersections([curve], [(0, 0)])[0]


def assert_mirrored(one, other):
    order = np.lexsort((other.u_a, other.u_b))
    np.testing.assert_allclose(other.points[order], one.points, atol=1e-8)
    np.testing.assert_allclose(other.u_b[order], one.u_a, atol=1e-6)
    mirrored = [
        (b0, b1, a0, a1) if b0 < b1 else (b1, b0, a1, a0) for a0, a1, b0, b1 in one.overlaps
    ]
    np.testing.assert_allclose(np.reshape(sorted(mirrored), (-1, 4)), other.overlaps, atol=1e-9)


def meet(a, b, **options):
    """What is found, once it is known that it lies on both curves and mirrors."""
    found = find_intersections(a, b, **options)
    assert_mirrored(found, find_intersections(b, a, **options))
    if len(found.u_a):
        np.testing.assert_allclose(place(a, found.u_a), found.points, atol=2e-9)
        np.testing.assert_allclose(place(b, found.u_b), found.points, atol=2e-9)
    return found


def test_random_curves_meet_where_polylines_do_and_nowhere_else():
    pairs = [random_pair(seed) for seed in seeds(PAIRS)]
    curves = [curve for pair in pairs for curve in pair]
    indices = np.arange(len(curves)).reshape(-1, 2)
    found = find_all_intersections(curves, indices)
    wrong = {
        seed: differences(a, b, its.points, FINE)
        for seed, (a, b), its in zip(seeds(PAIRS), pairs, found, strict=True)
        if differences(a, b, its.points, CHORDS) != (0, 0)
    }
    assert set(wrong.values()) <= {(0, 0)}, wrong
    for one, other in zip(found, find_all_intersections(curves, indices[:, ::-1]), strict=True):
        assert_mirrored(one, other)


@pytest.mark.parametrize("angle", [0.3, math.pi / 4, 2.0])
@pytest.mark.parametrize("radius", [0.5, 1.0, 3.0])
def test_circles_that_touch_meet_once(angle, radius):
    x, y = math.cos(angle), math.sin(angle)
    for apart in (2.0 + radius, 2.0 - radius):
        found = meet(circle(0, 0, 2.0), circle(apart * x, apart * y, radius))
        np.testing.assert_allclose(found.points, [(2.0 * x, 2.0 * y)], atol=1e-7)


def test_circles_that_miss_by_a_hair_do_not_meet_and_deeper_ones_meet_twice():
    assert len(meet(circle(0, 0, 1), circle(2 + 1e-8, 0, 1)).u_a) == 0
    assert len(meet(circle(0, 0, 1), circle(2 - 1e-8, 0, 1)).u_a) == 2


def test_a_parabola_touches_its_tangent_in_a_point():
    parabola = nurbs(2, [0, 0, 0, 1, 1, 1], [(-1, 1), (0, -1), (1, 1)])
    found = meet(parabola, line((-2, 0), (2, 0)))
    np.testing.assert_allclose(found.points, [(0.0, 0.0)], atol=1e-9)
    assert len(found.overlaps) == 0


def test_a_curve_crosses_its_tangent_at_a_point_of_inflection_once():
    cube = cubic((-1, -1), (-1 / 3, 1), (1 / 3, -1), (1, 1))
    found = meet(cube, line((-2, 0), (2, 0)))
    np.testing.assert_allclose(found.points, [(0.0, 0.0)], atol=1e-3)


def test_curves_that_share_an_end_meet_there():
    for other in (
        line((1, 0), (1, 1)),
        cubic((1, 0), (2, 0), (3, 0), (3, 1)),
        line((3, 0), (1, 0)),
    ):
        found = meet(line((0, 0), (1, 0)), other)
        np.testing.assert_allclose(found.points, [(1.0, 0.0)], atol=1e-12)
        assert len(found.overlaps) == 0


def test_lanes_shifted_along_themselves_overlap():
    lane = line((0, 0), (10, 3))
    found = meet(lane, moved(lane, 2.0, 0.6))
    np.testing.assert_allclose(found.overlaps, [(0.2, 1.0, 0.0, 0.8)], atol=1e-12)
    assert len(found.u_a) == 0
    found = meet(lane, backwards(moved(lane, 2.0, 0.6)))
    np.testing.assert_allclose(found.overlaps, [(0.2, 1.0, 1.0, 0.2)], atol=1e-12)
    assert len(meet(lane, moved(lane, 0.0, 1e-6)).overlaps) == 0


@pytest.mark.parametrize("degree", range(1, 8))
@pytest.mark.parametrize("away", [0.0, 1e5])
def test_a_curve_overlaps_each_piece_of_itself(degree, away):
    curve = random_curve(np.random.default_rng(degree), degree, 12, wild=True)
    curve = moved(curve, away, -away)
    begin, end = 1.234, 0.8 * curve.knots[-1]
    part = piece(curve, begin, end)
    found = meet(curve, refine(part, [0.321]) if degree > 1 else part)
    np.testing.assert_allclose(found.overlaps, [(begin, end, 0.0, end - begin)], atol=1e-6)
    found = meet(curve, backwards(part))
    np.testing.assert_allclose(found.overlaps, [(begin, end, end - begin, 0.0)], atol=1e-6)


def test_identical_curves_overlap_and_meet_where_the_curve_meets_itself():
    curve = random_curve(np.random.default_rng(3), 3, 12)
    found, itself = meet(curve, curve), find_self_intersections(curve)
    np.testing.assert_allclose(found.overlaps, [(0.0, 9.0, 0.0, 9.0)])
    assert len(found.u_a) == 2 * len(itself.u_a) > 0


@pytest.mark.parametrize("seed", range(8))
def test_loops_are_where_the_halves_of_a_curve_cross(seed):
    curve = random_curve(np.random.default_rng(seed), 3, 8)
    itself = find_self_intersections(curve)
    borders = np.linspace(0.0, 5.0, 41)
    parts = [piece(curve, u, v) for u, v in itertools.pairwise(borders)]
    count = 0
    for i in range(40):
        for j in range(i + 2, 40):
            count += len(polyline_crossings(parts[i], parts[j], 20)) if near(parts, i, j) else 0
    assert len(itself.u_a) == count
    assert (itself.u_a < itself.u_b).all()
    np.testing.assert_allclose(place(curve, itself.u_a), place(curve, itself.u_b), atol=1e-9)


def near(parts, i, j):
    boxes = [
        shapely.box(*p.points.min(axis=0), *p.points.max(axis=0)) for p in (parts[i], parts[j])
    ]
    return shapely.intersects(*boxes)


def test_loops_of_known_curves():
    loop = cubic((0, 0), (2, 1), (-1, 1), (1, 0))
    np.testing.assert_allclose(find_self_intersections(loop).points, [(0.5, 0.3)], atol=1e-12)
    cusp = cubic((0, 0), (1, 1), (0, 1), (1, 0))
    assert len(find_self_intersections(cusp).u_a) == 0
    zigzag = line((0, 0), (4, 0), (4, 2), (2, -2), (2, 3))
    found = find_self_intersections(zigzag)
    np.testing.assert_allclose(found.points, [(2.0, 0.0), (3.0, 0.0)], atol=1e-12)
    closed = find_self_intersections(circle(0, 0, 1))
    assert (closed.u_a.tolist(), closed.u_b.tolist()) == ([0.0], [4.0])


def test_a_curve_that_comes_back_on_itself_overlaps_itself():
    found = find_self_intersections(line((0, 0), (4, 0), (2, 0), (2, 3)))
    np.testing.assert_allclose(found.overlaps, [(0.5, 1.0, 2.0, 1.0)])


def test_a_cusp_is_met_once():
    cusp = cubic((0, 0), (1, 1), (0, 1), (1, 0))
    for other in (line((0.5, 0), (0.5, 2)), line((0, 0.75), (1, 0.75))):
        for found in (find_intersections(cusp, other), find_intersections(other, cusp)):
            np.testing.assert_allclose(found.points, [(0.5, 0.75)], atol=1e-6)


def test_polylines_that_meet_at_their_corners_meet_once():
    tent = line((0, 0), (1, 1), (2, 0))
    for other in (line((0, 1), (2, 1)), line((0, 2), (1, 1), (2, 2))):
        np.testing.assert_allclose(meet(tent, other).points, [(1.0, 1.0)], atol=1e-12)


def test_a_curve_without_length_meets_as_a_point():
    found = meet(nurbs(3, [0] * 4 + [1] * 4, [(1, 1)] * 4), line((0, 0), (2, 2)))
    np.testing.assert_allclose(found.points, [(1.0, 1.0)], atol=1e-9)


def test_copies_nearer_than_the_tolerance_overlap():
    curve = random_curve(np.random.default_rng(7), 3, 12)
    found = meet(moved(curve, 1e-7, 0.0), curve, tolerance=1e-6)
    assert len(found.overlaps) > 0
    assert found.tolerance == 1e-6


@pytest.mark.parametrize("seed", [4, 7])
def test_copies_too_near_to_tell_apart_are_one_at_a_coarser_tolerance_that_is_told(seed):
    curve = random_curve(np.random.default_rng(seed), 3, 12)
    copy = moved(curve, 1e-8, 0.0)
    found, coarser = find_intersections(copy, curve), find_intersections(copy, curve, 1e-8)
    assert (found.tolerance, coarser.tolerance) == (pytest.approx(1e-8), 1e-8)
    assert len(found.overlaps) == len(coarser.overlaps) == 1
    np.testing.assert_allclose(found.points, coarser.points, atol=1e-7)


def test_the_tolerance_of_a_pair_does_not_depend_on_the_other_pairs():
    curve = random_curve(np.random.default_rng(7), 3, 12)
    curves = [curve, moved(curve, 1e-8, 0.0), moved(curve, 1.0, 0.0)]
    found = find_all_intersections(curves, [(0, 2), (0, 1), (1, 2)])
    assert [its.tolerance for its in found] == [1e-9, pytest.approx(1e-8), 1e-9]


def test_a_tolerance_below_rounding_is_made_as_large_as_rounding():
    far = line((1e6, 0), (1e6, 1))
    assert find_intersections(far, far, 1e-12).tolerance == pytest.approx(1e-8)
    assert find_intersections(line((0, 0), (1, 0)), line((0, 0), (0, 1)), 1e-12).tolerance == 1e-12


def test_wild_weights_do_not_matter():
    random = np.random.default_rng(4)
    curve = random_curve(random, 4, 12)
    wild = Nurbs(4, curve.knots, curve.points, np.exp(random.uniform(-8.0, 8.0, 12)))
    assert differences(wild, curve, meet(wild, curve).points, 2000) == (0, 0)


def test_bad_input_is_refused():
    good = line((0, 0), (1, 1))
    with pytest.raises(ValueError, match="tolerance"):
        find_intersections(good, good, 0.0)
    with pytest.raises(ValueError, match="not finite"):
        find_intersections(good, line((0, 0), (1, math.nan)))
    with pytest.raises(ValueError, match="positive"):
        find_intersections(good, Nurbs(1, good.knots, good.points, np.array([1.0, 0.0])))
    assert find_all_intersections([good], []) == []
