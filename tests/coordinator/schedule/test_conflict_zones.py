"""Conflict zones of fleets against dense sampling: nothing missed, little added, joined rightly."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from coordinator.curves.bounds import parameter_of
from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import nurbs
from coordinator.schedule import conflict_zones
from coordinator.schedule.conflict_zones import find_zones
from tests.coordinator.schedule.fleets import CELL, fleet, line, random_path, rows_of
from tests.sweeps import seeds


def sample(curve, count):
    """Arc lengths and points, both ends included; the arc length is the exact one."""
    s = np.linspace(0.0, curve.length, count)
    return s, curve.evaluate(parameter_of(curve, s))


def gaps(p, q):
    return np.hypot(p[:, None, 0] - q[None, :, 0], p[:, None, 1] - q[None, :, 1])


def check_rows(rows, extent):
    """The rows of a zone follow each other and reach as far as its extent."""
    assert np.all(np.diff(rows[:, 0]) == 1.0)
    assert np.all(rows[:, 1] <= rows[:, 2])
    assert rows[0, 0] == np.floor(extent[0] / CELL)
    assert rows[-1, 0] == np.floor(extent[1] / CELL)
    assert rows[:, 1].min() == pytest.approx(extent[2], abs=1e-7)
    assert rows[:, 2].max() == pytest.approx(extent[3], abs=1e-7)


def check_pair(a, b, radii, margin):
    """One pair against dense samples: extents, rows from both sides, connected pieces."""
    curves, need = (a, b), radii[0] + radii[1] + margin
    chords = [chords_of(curve) for curve in curves]
    zones = find_zones(chords, radii, margin)
    samples = [sample(curve, 1201) for curve in curves]
    gap = gaps(samples[0][1], samples[1][1])
    slack = 2.0 * (chords[0].error + chords[1].error)
    for side in (0, 1):
        table = gap if side == 0 else gap.T
        mine, theirs = samples[side][0], samples[1 - side][0]
        covered = np.zeros(table.shape, dtype=bool)
        for k in range(len(zones.a)):
            rows = rows_of(zones, k, chords, radii, margin, side)
            check_rows(rows, np.roll(zones.extent[k], -2 * side))
            at = np.floor(mine / CELL) - rows[0, 0]
            inside = (at >= 0) & (at < len(rows))
            row = rows[at[inside].astype(int)]
            covered[inside] |= (theirs >= row[:, 1:2]) & (theirs <= row[:, 2:3])
            place = curves[side].evaluate(parameter_of(curves[side], mine[inside]))
            for end in (1, 2):
                s = row[:, end]
                there = curves[1 - side].evaluate(parameter_of(curves[1 - side], s))
                far = np.hypot(*(there - place).T)
                assert far.max(initial=0.0) <= need + slack + CELL <= need + 0.010_01
        assert not np.any((table < need) & ~covered)
    return zones, gap, need


@pytest.mark.parametrize("seed", seeds(12))
def test_no_conflict_is_missed_and_nothing_a_centimetre_too_far_is_added(seed):
    check_pair(random_path(seed), random_path(seed + 100), (0.25, 0.07), 0.03)


@settings(max_examples=12, derandomize=True, deadline=None, database=None)
@given(
    st.integers(0, 10**6),
    st.integers(0, 10**6),
    st.floats(0.02, 0.6),
    st.floats(0.02, 0.3),
    st.floats(0.0, 1.2),
)
def test_zones_of_any_two_paths_hold_what_dense_samples_tell(one, other, big, small, turn):
    check_pair(random_path(one, turn=turn), random_path(other, 7, turn), (big, small), 0.02)


def pieces(near):
    return ndimage.label(near)[1]


@pytest.mark.parametrize("seed", seeds(40))
def test_zones_are_the_connected_pieces_of_a_fine_grid(seed):
    a, b = random_path(seed), random_path(seed + 300)
    zones = find_zones([chords_of(a), chords_of(b)], (0.2, 0.2), 0.0)
    gap = gaps(sample(a, 1500)[1], sample(b, 1500)[1])
    # Where a slightly smaller or larger need gives another number, the paths graze.
    if pieces(gap < 0.39) == pieces(gap < 0.4) == pieces(gap < 0.41):
        assert len(zones.a) == pieces(gap < 0.4)


def same(one, other):
    names = ("a", "b", "extent", "first", "pairs")
    return all(getattr(one, n).tobytes() == getattr(other, n).tobytes() for n in names)


def zones_by_pair(chords, radii, margin):
    """Every pair by itself."""
    found = []
    for b in range(len(chords)):
        for a in range(b):
            zones = find_zones([chords[a], chords[b]], (radii[a], radii[b]), margin)
            found += [
                (a, b, *zones.extent[k], zones.pairs[zones.first[k] : zones.first[k + 1]].tobytes())
                for k in range(len(zones.a))
            ]
    return sorted(found)


def listed(zones):
    return [
        (int(a), int(b), *extent, zones.pairs[begin:end].tobytes())
        for a, b, extent, begin, end in zip(
            zones.a, zones.b, zones.extent, zones.first[:-1], zones.first[1:], strict=True
        )
    ]


def test_a_fleet_has_the_zones_of_all_its_pairs_in_order():
    chords = fleet(30)
    radii = np.random.default_rng(1).uniform(0.05, 0.4, len(chords))
    zones = listed(find_zones(chords, radii, 0.05))
    assert len(zones) > 100
    assert [zone[:6] for zone in zones] == [
        pytest.approx(zone[:6], abs=1e-9) for zone in zones_by_pair(chords, radii, 0.05)
    ]
    assert [zone[6] for zone in zones] == [zone[6] for zone in zones_by_pair(chords, radii, 0.05)]
    assert zones == sorted(zones)


def test_some_robots_have_the_zones_that_they_have_in_the_whole_fleet():
    chords = fleet(30)
    radii = [0.2] * len(chords)
    wanted = {35, 3, 17}
    part = find_zones(chords, radii, 0.05, among=[35, 3, 17])
    assert listed(part) == [
        zone for zone in listed(find_zones(chords, radii, 0.05)) if wanted & set(zone[:2])
    ]


def test_zones_seen_from_the_other_robot_are_mirrored():
    chords = fleet(12, 6.0)
    radii = [0.15] * len(chords)
    zones = find_zones(chords, radii, 0.05)
    back = find_zones(chords[::-1], radii, 0.05)
    last = len(chords) - 1
    mirrored = sorted(
        (last - b, last - a, *extent[[2, 3, 0, 1]])
        for a, b, extent in zip(back.a, back.b, back.extent, strict=True)
    )
    assert [zone[:6] for zone in listed(zones)] == mirrored


def test_the_answer_is_the_same_bytes_whatever_runs_the_tasks(monkeypatch):
    monkeypatch.setattr(conflict_zones, "_MANY", 1)
    chords = fleet(30)
    radii = [0.2] * len(chords)
    alone = find_zones(chords, radii, 0.05)
    with ThreadPoolExecutor(3) as threads:
        assert same(alone, find_zones(chords, radii, 0.05, threads))
        assert same(
            find_zones(chords, radii, 0.05, among=[4, 30]),
            find_zones(chords, radii, 0.05, threads, among=[4, 30]),
        )
    with ProcessPoolExecutor(1, get_context("forkserver")) as processes:
        assert same(alone, find_zones(chords, radii, 0.05, processes))


def extents(*curves, radius=0.25):
    zones = find_zones([chords_of(curve) for curve in curves], [radius] * len(curves), 0.0)
    return zones.extent


def test_crossing_lines_have_one_zone_of_the_known_size():
    found = extents(line((0, 2), (6, 2)), line((3, 0), (3, 5)))
    np.testing.assert_allclose(found, [[2.5, 3.5, 1.5, 2.5]], atol=1e-5)
    slanted = extents(line((0, 0), (6, 0)), line((1, -2), (5, 2)))
    reach = 0.5 * np.sqrt(2.0)
    middle = np.hypot(2.0, 2.0)
    np.testing.assert_allclose(
        slanted, [[3 - reach, 3 + reach, middle - reach, middle + reach]], atol=1e-5
    )


def test_a_row_of_a_right_crossing_holds_the_chord_of_a_circle():
    chords = [chords_of(line((0, 2), (6, 2))), chords_of(line((3, 0), (3, 5)))]
    zones = find_zones(chords, (0.25, 0.25), 0.0)
    rows = rows_of(zones, 0, chords, (0.25, 0.25), 0.0, 0)
    nearest = np.clip(3.0, rows[:, 0] * CELL, (rows[:, 0] + 1) * CELL)
    half = np.sqrt(np.maximum(0.25 - (nearest - 3.0) ** 2, 0.0))
    inner = slice(1, -1)
    np.testing.assert_allclose(rows[inner, 1], (2.0 - half)[inner], atol=1e-4)
    np.testing.assert_allclose(rows[inner, 2], (2.0 + half)[inner], atol=1e-4)


def test_paths_that_end_short_of_the_others_are_cut_there():
    np.testing.assert_allclose(
        extents(line((0, 0), (6, 0)), line((3, 4), (3, 0.3))),
        [[2.6, 3.4, 3.5, 3.7]],
        atol=1e-5,
    )


def test_a_path_that_crosses_twice_has_two_zones_and_a_shared_lane_one():
    a = line((0, 0), (10, 0))
    twice = extents(a, line((2, 3), (2, -2), (8, -2), (8, 3)), radius=0.2)
    assert [round(0.5 * (low + high), 6) for low, high in twice[:, :2]] == [2.0, 8.0]
    lane = extents(a, line((2, -3), (2, 0), (6, 0), (6, -3)), radius=0.15)
    np.testing.assert_allclose(lane, [[1.7, 6.3, 2.7, 7.3]], atol=1e-5)
    head_on = extents(a, line((6, -3), (6, 0), (2, 0), (2, -3)), radius=0.15)
    np.testing.assert_allclose(head_on, lane, atol=1e-5)


@pytest.mark.parametrize("flip", [1, -1])
def test_a_path_and_itself_forth_or_back_are_one_zone_from_end_to_end(flip):
    curve = random_path(3, 12, 0.2)
    other = nurbs(3, curve.knots, curve.points[::flip])
    chords = [chords_of(curve), chords_of(other)]
    zones = find_zones(chords, (0.1, 0.1), 0.0)
    np.testing.assert_allclose(zones.extent, [[0.0, curve.length] * 2], atol=1e-9)
    check_pair(curve, other, (0.1, 0.1), 0.0)


def test_parallel_lines_just_apart_by_the_need_have_a_zone_and_farther_ones_none():
    a = line((0, 0), (5, 0))
    np.testing.assert_allclose(
        extents(a, line((0, 0.4999), (5, 0.4999))), [[0.0, 5.0] * 2], atol=1e-9
    )
    assert len(extents(a, line((0, 0.5001), (5, 0.5001)))) == 0


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("seed", seeds(40))
def test_rows_of_a_goal_on_anothers_path_reach_the_goal_to_the_last_bit(seed, side):
    random = np.random.default_rng(seed)
    bend, goal = random.uniform(0.5, 2.0), random.uniform(4.0, 9.0)
    comes = line((0.0, -bend), (0.0, 0.0), (goal, random.uniform(-0.3, 0.3)))
    passes = line((goal + 0.1, -3.0), (goal + 0.1, 3.0))
    chords = [chords_of(curve) for curve in ((passes, comes) if side == 0 else (comes, passes))]
    zones = find_zones(chords, (0.25, 0.25), 0.0)
    rows = rows_of(zones, 0, chords, (0.25, 0.25), 0.0, side)
    assert rows[:, 2].max() == zones.extent[0, 3 - 2 * side] == comes.length


def test_a_robot_that_stays_where_it_is_blocks_the_others_like_a_disc():
    still = line((2.0, 0.3), (2.0, 0.3))
    found = extents(line((0, 0), (5, 0)), still)
    np.testing.assert_allclose(found, [[1.6, 2.4, 0.0, 0.0]], atol=1e-5)
    assert len(extents(still, still)) == 1
    assert len(extents(still, line((2.0, 0.9), (2.0, 0.9)))) == 0
    chords = [chords_of(line((0, 0), (5, 0))), chords_of(still)]
    zones = find_zones(chords, (0.25, 0.25), 0.0)
    (row,) = rows_of(zones, 0, chords, (0.25, 0.25), 0.0, 1)
    np.testing.assert_allclose(row, [0.0, 1.6, 2.4], atol=1e-5)
    rows = rows_of(zones, 0, chords, (0.25, 0.25), 0.0, 0)
    np.testing.assert_array_equal(rows[:, 1:], 0.0)


def test_a_fleet_of_none_and_of_one_has_no_zones():
    assert len(find_zones([], [], 0.0).a) == 0
    alone = find_zones([chords_of(random_path(1))], [0.3], 0.0)
    assert len(alone.a) == 0
    assert alone.first.tolist() == [0]
    with pytest.raises(ValueError, match="2 radii do not fit 1 paths"):
        find_zones([chords_of(random_path(1))], [0.3, 0.3], 0.0)
