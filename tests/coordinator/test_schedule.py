"""Orders of robots: against every permutation, priorities, deadlocks."""

import itertools
import math
import random

import numpy as np
import pytest

from coordinator import schedule
from coordinator.detours import blocking_pairs, stuck_pairs
from coordinator.motion import Motion, SpeedLimits
from coordinator.nurbs import nurbs
from coordinator.schedule import (
    Deadlock,
    Junctions,
    find_schedule,
    place_in_order,
    total_delay,
)
from coordinator.waiting import Track
from coordinator.zones import cut

NEED = 0.4


def line(*corners):
    corners = np.array(corners, dtype=float)
    arc = np.append(0.0, np.cumsum(np.hypot(*np.diff(corners, axis=0).T)))
    return nurbs(1, np.concatenate(([0.0], arc, arc[-1:])), corners)


def junctions_of(lines, speeds, tau=0.5, accel=1.0):
    tracks = [
        Track(SpeedLimits(curve.length, speed**2, accel, ()), cut(curve))
        for curve, speed in zip(lines, speeds, strict=True)
    ]
    return Junctions(tracks, [[NEED] * len(tracks)] * len(tracks), tau)


def random_junctions(seed, count):
    """Robots that cross a square, between places that are all apart."""
    dice = random.Random(seed)
    angles = [2 * math.pi * i / (2 * count) for i in range(2 * count)]
    places = [(3 * math.cos(a), 3 * math.sin(a)) for a in angles]
    dice.shuffle(places)
    lines = [line(a, b) for a, b in zip(places[::2], places[1::2], strict=True)]
    speeds = [dice.uniform(0.3, 1.0) for _ in lines]
    return junctions_of(lines, speeds, dice.choice([0.0, 0.5, 1.5]), dice.choice([0.6, math.inf]))


def best_of_all(junctions):
    results = [
        place_in_order(junctions, order)
        for order in itertools.permutations(range(len(junctions.tracks)))
    ]
    costs = [total_delay(junctions, r) for r in results if not isinstance(r, Deadlock)]
    return min(costs, default=None)


def least_gap(junctions, motions):
    """The least distance less the need between any two, within tau, by sampling."""
    end = max(motion.finish for motion in motions.values())
    time = np.arange(0.0, end + junctions.tau, 0.05)
    least = math.inf
    for i, j in itertools.permutations(motions, 2):
        for shift in {0.0, 0.5 * junctions.tau, junctions.tau}:
            apart = _at(junctions, motions, i, time) - _at(junctions, motions, j, time + shift)
            least = min(least, float(np.hypot(*apart.T).min()) - NEED)
    return least


def _at(junctions, motions, index, time):
    borders = junctions.tracks[index].cells.borders
    reached, left = motions[index].reached(borders), motions[index].left(borders)
    known = np.concatenate((left[:1], np.column_stack((reached, left))[1:-1].ravel(), reached[-1:]))
    arcs = np.concatenate((borders[:1], np.repeat(borders[1:-1], 2), borders[-1:]))
    s = np.interp(time, known, arcs)
    centers = junctions.tracks[index].cells.centers
    middle = 0.5 * (borders[:-1] + borders[1:])
    return np.column_stack([np.interp(s, middle, centers[:, axis]) for axis in (0, 1)])


@pytest.mark.parametrize("count", [2, 3, 4])
@pytest.mark.parametrize("seed", range(6))
def test_a_schedule_is_found_when_any_order_works_and_is_nearly_the_best(seed, count):
    junctions = random_junctions(10 * seed + count, count)
    best = best_of_all(junctions)
    found = find_schedule(junctions, [0] * count, 60)
    if best is None:
        assert isinstance(found, Deadlock)
        return
    cost = total_delay(junctions, found)
    assert cost >= best - 1e-6
    assert cost <= 1.25 * best + 1e-6
    # Centres of cells stand for places: half a cell of each robot may be missing.
    assert least_gap(junctions, found) >= -0.01


@pytest.mark.parametrize("seed", range(4))
def test_more_effort_is_never_worse(seed):
    junctions = random_junctions(seed, 4)
    costs = []
    for effort in (0, 5, 40):
        found = find_schedule(junctions, [0] * 4, effort)
        costs.append(total_delay(junctions, found))
    assert costs == sorted(costs, reverse=True)


def test_of_two_robots_the_faster_goes_first_and_a_priority_overrules_it():
    lines = [line((-3, 0), (3, 0)), line((0, -3), (0, 3))]
    junctions = junctions_of(lines, [0.5, 0.51], tau=1.0)
    alone = [Motion(track.limits, []).finish for track in junctions.tracks]
    plain = find_schedule(junctions, [0, 0], 0)
    assert plain[1].finish == pytest.approx(alone[1])
    assert plain[0].finish > alone[0] + 0.5
    ruled = find_schedule(junctions, [1, 0], 20)
    assert ruled[0].finish == pytest.approx(alone[0])
    assert ruled[1].finish > alone[1] + 0.5


def test_robots_that_never_meet_do_not_wait():
    lines = [line((0, y), (5, y)) for y in range(4)]
    junctions = junctions_of(lines, [0.5] * 4)
    assert junctions.conflicts == {}
    assert total_delay(junctions, find_schedule(junctions, [0] * 4, 5)) == 0.0


def test_a_robot_that_ends_on_anothers_way_lets_it_pass_first():
    lines = [line((0, 0), (5, 0)), line((2, 3), (2, 0.2))]
    junctions = junctions_of(lines, [0.2, 1.0])
    found = find_schedule(junctions, [0, 0], 10)
    assert not isinstance(found, Deadlock)
    assert found[1].finish > found[0].reached(np.array([2.0]))[0]


def test_two_that_swap_places_on_one_line_are_a_deadlock_of_both():
    junctions = junctions_of([line((0, 0), (5, 0)), line((5, 0), (0, 0))], [1.0, 0.9])
    found = find_schedule(junctions, [0, 0], 5)
    assert isinstance(found, Deadlock)
    assert {found.loser, *found.winners} == {0, 1}
    assert stuck_pairs(junctions) == [(0, 1)]
    assert blocking_pairs(junctions, found) == [(0, 1)]


def test_a_chain_of_goals_in_the_way_is_untangled():
    """Each robot's goal lies on the next one's way: only one order works."""
    corners = [((x, -2.0), (x, 0.0), (x + 4.0, 0.0)) for x in (0.0, 2.0, 4.0, 6.0)]
    lines = [line(*three) for three in corners]
    junctions = junctions_of(lines, [0.5, 0.6, 0.7, 0.8])
    best = best_of_all(junctions)
    found = find_schedule(junctions, [0] * 4, 10)
    assert (best is None) == isinstance(found, Deadlock)


def test_the_same_input_gives_the_same_schedule():
    results = [find_schedule(random_junctions(3, 4), [0] * 4, 20) for _ in range(2)]
    assert [results[0][i].waits for i in range(4)] == [results[1][i].waits for i in range(4)]
    assert list(results[0]) == list(results[1])


def test_a_robot_with_another_path_meets_the_others_as_if_it_had_been_there_before():
    junctions, other = random_junctions(5, 4), random_junctions(6, 4)
    tracks = [*junctions.tracks[:2], other.tracks[2], junctions.tracks[3]]
    junctions.take(2, other.tracks[2])
    fresh = Junctions([Track(t.limits, t.cells) for t in tracks], [[NEED] * 4] * 4, junctions.tau)
    assert list(junctions.conflicts) == list(fresh.conflicts)
    for pair, conflict in fresh.conflicts.items():
        assert junctions.conflicts[pair].zones == conflict.zones
    for mine, same in zip(junctions.tracks, fresh.tracks, strict=True):
        assert (mine.harmless, mine.anywhere) == (same.harmless, same.anywhere)


def test_waiting_places_lie_before_zones_and_outside_of_all_others():
    junctions = random_junctions(5, 4)
    for index, track in enumerate(junctions.tracks):
        spans = []
        for pair, conflict in junctions.conflicts.items():
            if index in pair:
                side = pair.index(index)
                spans += [((z.a0, z.a1), (z.b0, z.b1))[side] for z in conflict.zones]
        assert set(track.harmless) <= set(track.anywhere)
        for s in track.harmless:
            assert not any(begin <= s <= end for begin, end in spans)
        for s in track.anywhere:
            assert min(abs(begin - s) for begin, _ in spans) < track.cells.size


def test_improving_never_leaves_the_priorities_that_the_first_order_kept(monkeypatch):
    tried = []
    place = schedule.place_in_order

    def spy(junctions, order):
        tried.append((order, place(junctions, order)))
        return tried[-1][1]

    monkeypatch.setattr(schedule, "place_in_order", spy)
    priorities = [1, 0, 0, 1, 0]
    improved = 0
    for seed in range(30):
        tried.clear()
        junctions = random_junctions(seed, 5)
        schedule.find_schedule(junctions, priorities, 60)
        if isinstance(tried[0][1], Deadlock):
            continue
        delays = [total_delay(junctions, r) for _, r in tried if not isinstance(r, Deadlock)]
        improved += min(delays) < delays[0] - 1e-6
        for order, _ in tried:
            assert [priorities[index] for index in order] == [1, 1, 0, 0, 0]
    assert improved > 3
