"""Zones, rows and waiting places of a fleet; another track gives what building all anew gives."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.schedule.junctions import Junctions
from coordinator.schedule.track import CELL
from coordinator.schedule.waiting_kernels import PLACE
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import (
    MARGIN,
    NEED,
    RADIUS,
    Fleet,
    fleet_on,
    random_fleet,
    track_on,
    winding_fleet,
)


def parts(value):
    """All arrays of nested tuples and objects, in order."""
    if isinstance(value, np.ndarray | float | int | bool):
        return [np.asarray(value)]
    items = value if isinstance(value, tuple | list) else vars(value).values()
    return [part for item in items for part in parts(item)]


def facts(junctions):
    """Everything that searches read from junctions, robot by robot."""
    found = parts(junctions.zones)
    for index in range(len(junctions.tracks)):
        found += [junctions.zones_of(index), np.array(junctions.near(index))]
        found += parts(junctions.rows_of(index)[0])
        for anywhere in (True, False):
            approach = junctions.approach(index, anywhere)
            found += [*parts(approach.rows), *parts(approach.ride), approach.rest]
    return found


def agree(one, two):
    """Tell whether two junctions say the same, to the last bit."""
    return all(np.array_equal(a, b) for a, b in zip(facts(one), facts(two), strict=True))


def near(fleet, index):
    """The robots whose paths come nearer than allowed, by sampling."""
    sampled = [curve.at_arc(np.linspace(0.0, curve.length, 801)) for curve in fleet.curves]
    return [
        other
        for other in range(len(sampled))
        if other != index
        and np.hypot(*(sampled[index][:, None] - sampled[other]).transpose(2, 0, 1)).min() < NEED
    ]


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 50),
    moves=st.lists(st.tuples(st.integers(0, 4), st.integers(0, 50)), min_size=1, max_size=4),
    used=st.booleans(),
)
def test_a_robot_with_another_track_gives_what_building_anew_gives(seed, moves, used):
    fleet = random_fleet(seed, 5)
    first, before = fleet.junctions, facts(fleet.junctions)
    junctions = first if used else fleet.anew().junctions
    for index, other in moves:
        track = random_fleet(other, 5).junctions.tracks[index]
        junctions = junctions.with_track(index, track)
        if used:
            facts(junctions)
    tracks = list(junctions.tracks)
    assert agree(junctions, Junctions(tracks, [RADIUS] * 5, MARGIN, first.tau))
    assert all(np.array_equal(a, b) for a, b in zip(before, facts(first), strict=True))


def test_junctions_with_another_track_forget_what_was_known_of_the_old_one():
    """`known` holds times: those of zones that are gone must not answer for new ones."""
    fleet = fleet_on([line((0, 0), (6, 0)), line((3, -3), (3, 3))])
    fleet.junctions.rows_of(0)[1].stamp[:] = 77
    moved = fleet.junctions.with_track(1, track_on(line((4, -3), (4, 3))))
    assert moved.rows_of(0)[1].stamp.tolist() == [0]
    assert fleet.junctions.rows_of(0)[1].stamp.tolist() == [77]


@pytest.mark.parametrize("seed", range(4))
def test_robots_are_near_whose_paths_come_too_near(seed):
    fleet = winding_fleet(seed, 4) if seed % 2 else random_fleet(seed, 6)
    for index in range(len(fleet.curves)):
        assert list(fleet.junctions.near(index)) == near(fleet, index)


def test_robots_that_never_meet_have_no_zones_and_wait_nowhere():
    junctions = fleet_on([line((0, y), (5, y)) for y in range(4)]).junctions
    assert len(junctions.zones.a) == 0
    for index in range(4):
        assert junctions.near(index) == ()
        assert junctions.approach(index).ride.stations[:, PLACE].tolist() == [0.0, 5.0]


@pytest.mark.parametrize("seed", range(4))
def test_a_robots_zones_and_their_spans_are_those_on_its_side(seed):
    junctions = random_fleet(seed, 6).junctions
    zones, seen = junctions.zones, np.zeros(len(junctions.zones.a), int)
    for index in range(6):
        mine = junctions.zones_of(index)
        seen[mine] += 1
        for k, span in zip(mine, junctions.span(index, mine), strict=True):
            a0, a1, b0, b1 = zones.extent[k]
            assert span.tolist() == ([a0, a1] if zones.a[k] == index else [b0, b1])
            assert index in (zones.a[k], zones.b[k])
    assert np.all(seen == 2)


@pytest.mark.parametrize("fleet", [random_fleet(5, 5), winding_fleet(2, 3), winding_fleet(5, 4)])
def test_robots_wait_shortly_before_zones_and_if_asked_outside_of_all(fleet):
    junctions = fleet.junctions
    for index in range(len(fleet.curves)):
        spans = junctions.span(index, junctions.zones_of(index))
        every, outside = (
            junctions.approach(index, anywhere).ride.stations[:, PLACE]
            for anywhere in (True, False)
        )
        assert set(outside) <= set(every)
        assert np.all(np.diff(every) > 0.0)
        for stations in (every, outside):
            assert stations[0] == 0.0
            assert stations[-1] == fleet.curves[index].length
        for s in every[1:-1]:
            assert 0.0 < min((begin - s for begin, _ in spans if begin > s), default=9) < 2 * CELL
        for s in outside[1:-1]:
            assert not any(begin <= s <= end for begin, end in spans)


def test_a_zone_may_be_waited_for_wherever_it_does_not_hold_the_start():
    junctions = winding_fleet(2, 3).junctions
    for index in range(3):
        stations = junctions.approach(index).ride.stations[:, PLACE]
        for begin, _ in junctions.span(index, junctions.zones_of(index)):
            assert np.any((stations < begin) & (begin - stations < 2 * CELL)) or begin < 2 * CELL


def test_rows_cover_every_place_at_which_two_robots_are_too_near():
    fleet = winding_fleet(4, 3)
    for me in range(3):
        rows = fleet.junctions.rows_of(me)[0]
        for other in fleet.junctions.near(me):
            s = np.linspace(0.0, fleet.curves[me].length, 1501)
            t = np.linspace(0.0, fleet.curves[other].length, 1501)
            gaps = fleet.curves[me].at_arc(s)[:, None] - fleet.curves[other].at_arc(t)
            at, to = np.nonzero(np.hypot(*gaps.transpose(2, 0, 1)) < NEED)
            owner = np.repeat(rows.other, np.diff(rows.first))
            size = fleet.junctions.tracks[me].cell
            for cell in np.unique((s[at] / size).astype(int)):
                theirs = t[to[(s[at] / size).astype(int) == cell]]
                here = (rows.cell == cell) & (owner == other)
                low, high = rows.low[here], rows.high[here]
                inside = (theirs[:, None] >= low - 1e-9) & (theirs[:, None] <= high + 1e-9)
                assert np.all(inside.any(axis=1))


def test_an_executor_changes_nothing():
    fleet = winding_fleet(3, 4)
    given = fleet.junctions
    with ThreadPoolExecutor(2) as threads:
        other = Junctions(given.tracks, given.radii, given.margin, given.tau, threads)
    assert agree(given, other)


def test_a_larger_fleet_of_the_same_paths_keeps_the_zones_of_the_smaller():
    fleet = random_fleet(3, 5)
    small = Fleet(
        fleet.curves[:4], Junctions(fleet.junctions.tracks[:4], [RADIUS] * 4, MARGIN, 1.0)
    )
    zones, fewer = fleet.junctions.zones, small.junctions.zones
    kept = zones.b < 4
    assert np.array_equal(zones.extent[kept], fewer.extent)
    assert np.array_equal(zones.a[kept], fewer.a)
