"""Zone by zone: against all ways to decide, a relaxation without inertia, and sampling."""

import itertools
import math
from statistics import mean

import numpy as np
import pytest

from coordinator.motion.velocity_profile import Motion, Wait
from coordinator.schedule.conflict_search import ConflictSearch
from coordinator.schedule.forbidden_interval_kernels import AFTER, FREE, Passage, clash
from coordinator.schedule.safe_intervals import earliest_motion
from coordinator.schedule.timetable import Motions
from tests.coordinator.schedule.fleets import line
from tests.coordinator.schedule.fleets_on_lines import (
    MARGIN,
    NEED,
    RADIUS,
    alone,
    fleet_on,
    placed,
    random_fleet,
    tangled_fleet,
    winding_fleet,
)
from tests.oracle_exhaustive import earliest_times
from tests.oracle_zones import Course, find_zones

ROOM = 0.02
MANY = 4000
SEEDS = range(1, 20)


def tangled(seed, count):
    """Some zones in every pair, and few enough to try all ways to decide them."""
    return tangled_fleet(seed, count, corners=3)


def delay(fleet, motions):
    tracks = fleet.junctions.tracks
    return sum(m.finish - track.alone for m, track in zip(motions, tracks, strict=True))


def settle(fleet, decided):
    """All motions for one way to decide all zones, {zone: who comes second}; None when none.

    As in the search, nobody waits where somebody has yet to pass.
    """
    junctions, count = fleet.junctions, len(fleet.curves)
    modes = []
    for index in range(count):
        zones = junctions.zones_of(index).tolist()
        modes.append(np.array([AFTER if decided[z] == index else FREE for z in zones], np.int64))
    table = placed(fleet, [alone(track) for track in junctions.tracks])
    for _ in range(12):
        before = [motion.finish for motion in table.found]
        for index in range(count):
            motion = earliest_motion(junctions, table, index, modes[index], anywhere=False)
            if motion is None:
                return None
            table.put(index, motion)
        if [motion.finish for motion in table.found] == before:
            return table.all()
    return None


def best_of_all(fleet, fixed=None):
    """The least sum of delays over all ways to decide all zones, infinite if none works."""
    zones = fleet.junctions.zones
    sides = list(zip(zones.a.tolist(), zones.b.tolist(), strict=True))
    for zone, second in (fixed or {}).items():
        sides[zone] = (second,)
    plans = (settle(fleet, dict(enumerate(way))) for way in itertools.product(*sides))
    return min((delay(fleet, plan) for plan in plans if plan is not None), default=math.inf)


def relaxed(fleet, room=-ROOM):
    """The least sum of arrivals without inertia and with rests anywhere, by another judge."""
    courses = [
        Course(curve.at_arc, curve.length, RADIUS, math.sqrt(track.limits.top))
        for curve, track in zip(fleet.curves, fleet.junctions.tracks, strict=True)
    ]
    zones = find_zones(courses, MARGIN + room)
    least, tau = math.inf, fleet.junctions.tau
    for orders in itertools.product(*(zone.orders for zone in zones)):
        times = earliest_times(courses, orders, tau, 200.0)
        if times is not None:
            least = min(least, sum(float(arrivals[-1]) for arrivals in times))
    return least


def searched(fleet, nodes=MANY):
    """The table that a search for all robots leaves, and whether it found anything."""
    table = placed(fleet, [None] * len(fleet.curves))
    found = ConflictSearch(fleet.junctions, table, range(len(fleet.curves))).run(math.inf, nodes)
    return table, found


def test_a_search_tells_whether_it_came_to_its_end():
    fleet = tangled(next(iter(SEEDS)), 3)
    for nodes, complete in ((1, False), (MANY, True)):
        table = placed(fleet, [None] * len(fleet.curves))
        search = ConflictSearch(fleet.junctions, table, range(len(fleet.curves)))
        search.run(math.inf, nodes)
        assert search.complete is complete


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("make", [random_fleet, tangled])
def test_three_robots_get_the_best_of_all_ways_to_decide_their_zones(seed, make):
    fleet = make(seed, 3)
    table, found = searched(fleet)
    best = best_of_all(fleet)
    if not found:
        assert best == math.inf
        return
    cost = delay(fleet, table.all())
    assert cost <= best + 1e-6
    assert sum(motion.finish for motion in table.all()) >= relaxed(fleet) - 1e-6
    assert fleet.slack(table.all(), step=0.04) >= -2e-3


def test_without_inertia_nothing_better_is_known_to_another_judge():
    """Rests anywhere and no cells: a few of them are better, hardly any by much."""
    excess = []
    for seed in SEEDS:
        fleet = tangled(seed, 3)
        table, found = searched(fleet)
        if found and math.isinf(fleet.junctions.tracks[0].limits.accel):
            arrivals = sum(motion.finish for motion in table.all())
            excess.append(arrivals - relaxed(fleet, ROOM))
    assert len(excess) > 5
    assert mean(excess) < 0.0
    assert max(excess) < 0.02


@pytest.mark.parametrize("seed", range(4))
def test_two_robots_on_winding_paths_get_the_best_too(seed):
    fleet = winding_fleet(seed, 2)
    table, found = searched(fleet)
    best = best_of_all(fleet)
    if not found:
        assert best == math.inf
    else:
        assert delay(fleet, table.all()) <= best + 1e-6
        assert fleet.slack(table.all(), step=0.04) >= -2e-3


def test_one_passes_first_here_and_second_there_where_that_is_better():
    """No order of whole robots is as good: each is early at one of the two crossings."""
    fleet = fleet_on([line((0, 0), (12, 0)), line((10, -1), (10, 3), (2, 3), (2, -9))], tau=0.5)
    table, _ = searched(fleet)
    first, second = table.all()
    assert first.waits == second.waits == []
    assert first.reached(np.array([2.0])) < second.reached(np.array([4 + 8 + 3.0]))
    assert first.reached(np.array([10.0])) > second.reached(np.array([1.0]))


@pytest.mark.parametrize("seed", [0, 4, 5, 9])
def test_robots_that_are_not_chosen_keep_their_motions(seed):
    fleet = tangled_fleet(seed, 5)
    table = placed(fleet, [None] * 5)
    for index in range(5):
        motion = earliest_motion(fleet.junctions, table, index)
        if motion is None:
            return
        table.put(index, motion)
    before, was = list(table.found), delay(fleet, table.all())
    found = ConflictSearch(fleet.junctions, table, (1, 3, 4)).run(math.inf, 60)
    assert found
    assert table.found[0] is before[0]
    assert table.found[2] is before[2]
    assert delay(fleet, table.all()) <= was + 1e-6
    assert fleet.slack(table.all(), step=0.04) >= -2e-3


def contents(table):
    knots = [range(size) for size in table.table.knots]
    rows = [part[i, k].tolist() for part in table.table[:3] for i, k in enumerate(knots)]
    return rows, table.table.serial.tolist(), table.placed.tolist(), list(table.found)


@pytest.mark.parametrize("seed", range(6))
def test_a_bound_that_nothing_meets_leaves_everything_as_it_was(seed):
    fleet = tangled(seed, 3)
    table, found = searched(fleet)
    if not found:
        assert contents(table)[2:] == ([False] * 3, [None] * 3)
        return
    cost, before = delay(fleet, table.all()), contents(table)
    search = ConflictSearch(fleet.junctions, table, range(3))
    assert not search.run(cost, MANY)
    assert contents(table) == before
    assert not search.run(0.0, MANY)
    assert contents(table) == before


@pytest.mark.parametrize("seed", [1, 2, 3, 4, 6, 8, 9])
def test_the_cost_of_passing_a_zone_second_is_that_of_the_best_such_plan(seed):
    fleet = tangled(seed, 3)
    table, found = searched(fleet)
    if not found:
        return
    cost, before = delay(fleet, table.all()), contents(table)
    zones = fleet.junctions.zones
    for zone in range(len(zones.a)):
        for second in (int(zones.a[zone]), int(zones.b[zone])):
            search = ConflictSearch(fleet.junctions, table, range(3))
            extra = search.cost_if(zone, second, MANY)
            best = best_of_all(fleet, {zone: second})
            assert math.isinf(extra) == math.isinf(best)
            assert extra <= max(best - cost, 0.0) + 1e-6 or math.isinf(extra)
            assert extra >= -1e-6
            assert contents(table) == before


@pytest.mark.parametrize("seed", range(6))
def test_more_nodes_are_never_worse(seed):
    fleet = tangled_fleet(seed, 5)
    costs = []
    for nodes in (1, 5, 30, 200):
        table, found = searched(fleet, nodes)
        costs.append(delay(fleet, table.all()) if found else math.inf)
    assert costs == sorted(costs, reverse=True)


@pytest.mark.parametrize("seed", range(8))
def test_robots_clash_in_a_zone_when_sampling_says_so(seed):
    """A zone is one piece: who keeps out of it passes it first or second throughout."""
    fleet = winding_fleet(seed, 2) if seed % 2 else random_fleet(seed, 2)
    junctions, dice = fleet.junctions, np.random.default_rng(seed)
    told = []
    for late in dice.uniform(-8.0, 8.0, 12):
        departs = (max(late, 0.0), max(-late, 0.0))
        motions = [alone(t, depart) for t, depart in zip(junctions.tracks, departs, strict=True)]
        table = placed(fleet, motions)
        one, two = junctions.rows_of(0)[0], junctions.rows_of(1)[0]
        tell = [
            clash(
                Passage(0, one, z),
                Passage(1, two, z),
                table.table,
                junctions.tracks[0].cell,
                junctions.tau,
            )
            for z in range(len(one.other))
        ]
        slack = fleet.slack(motions)
        told.append((slack, min(tell, default=math.inf)))
        if slack < -0.002:
            assert told[-1][1] < math.inf
        if slack > 0.025:
            assert told[-1][1] == math.inf
    assert len(told) == 12


@pytest.mark.parametrize(("depart", "clashes"), [(4.0, False), (40.0, True)])
def test_a_rest_in_a_zone_is_a_clash_until_it_is_left(depart, clashes):
    fleet = fleet_on([line((0, 0), (6, 0)), line((3, -3), (3, 3))])
    tracks = fleet.junctions.tracks
    passages = [Passage(k, fleet.junctions.rows_of(k)[0], 0) for k in (0, 1)]
    resting = Motion(tracks[0].limits, [Wait(3.0, depart, -1)])
    table = placed(fleet, [resting, alone(tracks[1], 10.0)])
    when = clash(*passages, table.table, tracks[0].cell, 0.5)
    assert (when < math.inf) == clashes


def test_a_robot_that_starts_just_before_a_zone_comes_after_the_one_that_has_left_it():
    fleet = fleet_on([line((0, 0), (6, 0)), line((-NEED - 0.002, 0), (3, 0), (3, -3))])
    tracks = fleet.junctions.tracks
    passages = [Passage(k, fleet.junctions.rows_of(k)[0], 0) for k in (0, 1)]
    assert 0.0 < passages[1].rows.enters[0] < tracks[1].cell
    for depart, clashes in ((1.5, False), (0.2, True)):
        table = placed(fleet, [alone(tracks[0], 0.0), alone(tracks[1], depart)])
        when = clash(*passages, table.table, tracks[0].cell, 0.5)
        assert (when < math.inf) == clashes
    table = Motions(fleet.junctions.lengths())
    assert ConflictSearch(fleet.junctions, table, [0, 1]).run(math.inf, 3)
