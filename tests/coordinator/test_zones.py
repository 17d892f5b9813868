"""Conflict zones against brute force: nothing missed, little added, mirrors."""

import numpy as np
import pytest

from coordinator.nurbs import nurbs
from coordinator.zones import cut, find_conflict


def line(*corners):
    corners = np.array(corners, dtype=float)
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    return nurbs(1, np.concatenate(([0.0], arc, arc[-1:])), corners)


def random_path(seed):
    random = np.random.default_rng(seed)
    points = random.uniform(0.0, 6.0, (7, 2))
    knots = np.concatenate((np.zeros(4), [1.0, 2.0, 3.0], np.full(4, 4.0)))
    return nurbs(3, knots, points)


def banned(runs, mine, others):
    """The conflicting pairs of cells as a table."""
    table = np.zeros((len(mine.centers), len(others.centers)), dtype=bool)
    for cell, low, high in zip(runs.cell, runs.low, runs.high, strict=True):
        table[cell, low : high + 1] = True
    return table


def distances(a, b, s, t):
    return np.hypot(*np.moveaxis(a.at_arc(s)[:, None] - b.at_arc(t)[None], 2, 0))


@pytest.mark.parametrize("seed", range(10))
def test_no_conflict_is_missed_and_little_is_added(seed):
    a, b, need = random_path(seed), random_path(seed + 100), 0.35
    cells = cut(a), cut(b)
    conflict = find_conflict(*cells, need)
    random = np.random.default_rng(seed)
    s = np.append(random.uniform(0, a.length, 700), [0.0, a.length])
    t = np.append(random.uniform(0, b.length, 700), [0.0, b.length])
    gap = distances(a, b, s, t)
    if conflict is None:
        assert gap.min() >= need
        return
    table = banned(conflict.of_a, *cells)
    of_s = [cells[0].at(x) for x in s]
    of_t = [cells[1].at(x) for x in t]
    found = table[np.ix_(of_s, of_t)]
    assert not np.any((gap < need) & ~found)
    # A cell is as wide as both half cells of the test and both of the places in them.
    assert gap[found].max(initial=0.0) <= need + 2.0 * max(c.size for c in cells)


@pytest.mark.parametrize("seed", range(10))
def test_zones_seen_from_the_other_robot_are_mirrored(seed):
    a, b = cut(random_path(seed)), cut(random_path(seed + 50))
    ab, ba = find_conflict(a, b, 0.4), find_conflict(b, a, 0.4)
    if ab is None or ba is None:
        assert ab is ba
        return
    for one, other in ((ab.of_a, ba.of_b), (ab.of_b, ba.of_a)):
        for name in ("cell", "low", "high"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    mirrored = {(z.b0, z.b1, z.a0, z.a1) for z in ba.zones}
    assert {(z.a0, z.a1, z.b0, z.b1) for z in ab.zones} == mirrored
    np.testing.assert_array_equal(banned(ab.of_a, a, b), banned(ab.of_b, b, a).T)


@pytest.mark.parametrize("seed", range(10))
def test_every_conflict_lies_in_a_zone_and_zones_end_where_conflicts_end(seed):
    a, b = cut(random_path(seed)), cut(random_path(seed + 50))
    conflict = find_conflict(a, b, 0.4)
    if conflict is None:
        return
    rows, columns = np.nonzero(banned(conflict.of_a, a, b))
    inside = [
        (a.borders[rows] >= z.a0)
        & (a.borders[rows + 1] <= z.a1)
        & (b.borders[columns] >= z.b0)
        & (b.borders[columns + 1] <= z.b1)
        for z in conflict.zones
    ]
    assert np.any(inside, axis=0).all()
    for zone, mine in zip(conflict.zones, inside, strict=True):
        assert a.borders[rows[mine]].min() == zone.a0
        assert b.borders[columns[mine] + 1].max() == zone.b1


def test_crossing_lines_have_one_zone_of_the_known_size():
    a, b = line((0, 2), (6, 2)), line((3, 0), (3, 5))
    (zone,) = find_conflict(cut(a), cut(b), 0.5).zones
    for got, wanted in zip((zone.a0, zone.a1, zone.b0, zone.b1), (2.5, 3.5, 1.5, 2.5), strict=True):
        assert got == pytest.approx(wanted, abs=0.011)


def test_a_path_that_crosses_twice_has_two_zones():
    a = line((0, 0), (10, 0))
    b = line((2, 3), (2, -2), (8, -2), (8, 3))
    zones = find_conflict(cut(a), cut(b), 0.4).zones
    assert [round(0.5 * (z.a0 + z.a1), 1) for z in zones] == [2.0, 8.0]


def test_a_shared_lane_is_one_zone():
    a, b = line((0, 0), (8, 0)), line((2, -3), (2, 0), (6, 0), (6, -3))
    assert len(find_conflict(cut(a), cut(b), 0.3).zones) == 1


def test_paths_apart_have_no_conflict_however_their_boxes_lie():
    assert find_conflict(cut(line((0, 0), (5, 0))), cut(line((0, 2), (5, 2))), 0.5) is None
    around = line((-1, -1), (6, -1), (6, 6))
    assert find_conflict(cut(line((0, 0), (5, 5))), cut(around), 0.5) is None


def test_paths_just_apart_by_the_need_have_at_most_their_cells_as_slack():
    a, near, far = line((0, 0), (5, 0)), line((0, 0.499), (5, 0.499)), line((0, 0.52), (5, 0.52))
    assert find_conflict(cut(a), cut(near), 0.5) is not None
    assert find_conflict(cut(a), cut(far), 0.5) is None


@pytest.mark.parametrize("length", [0.002, 0.3, 19.0, 150.0, 900.0])
def test_cells_cover_the_path_and_are_not_too_many(length):
    cells = cut(line((0, 0), (length, 0)))
    assert cells.borders[0] == 0.0
    assert cells.borders[-1] == pytest.approx(length)
    assert cells.size <= 0.05
    assert len(cells.centers) <= max(4001, length / 0.05 + 1)
    for s in (0.0, 0.4 * length, length):
        at = cells.at(s)
        assert cells.borders[at] <= s <= cells.borders[at + 1]
