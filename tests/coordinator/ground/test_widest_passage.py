"""The roomiest way against searches for ways that are a little narrower and a little wider."""

import math

import numpy as np
import pytest

from coordinator.ground.free_space import NO_DISCS
from coordinator.ground.grown_floor import GrownFloor
from coordinator.ground.growth import TURN_STEP, Rings
from coordinator.ground.widest_passage import widest_reach
from tests.floors import box, random_floor, random_places
from tests.sweeps import enough, seeds

BOX = box(0, 0, 10, 8)
START, GOAL = np.array((1.0, 4.0)), np.array((9.0, 4.0))


def widest(obstacles, start=START, goal=GOAL, most=3.0):
    return widest_reach(Rings.of(obstacles, np.array(BOX)), start, goal, most)


def test_a_door_passes_half_its_width():
    walls = [box(5, 0, 5.2, 3), box(5, 3.7, 5.2, 8)]
    assert widest(walls) == pytest.approx(0.35)
    assert widest(walls, GOAL, START) == pytest.approx(0.35)
    assert widest(walls, most=0.3) is None


def test_the_wider_of_two_doors_counts():
    walls = [box(5, 0, 5.2, 3), box(5, 3.7, 5.2, 6), box(5, 6.9, 5.2, 8)]
    assert widest(walls) == pytest.approx(0.45)


@pytest.mark.parametrize("gap", [0.0, 0.25])
def test_a_yard_closes_one_place_in_and_the_way_past_it_stays(gap):
    yard = [box(7, 2, 9.4, 2.2), box(7, 6, 9.4, 6.2), box(7, 2, 7.2, 6), box(9.2, 2, 9.4, 6 - gap)]
    goal = np.array((8.4, 4.0))
    assert widest(yard, START, goal) == pytest.approx(0.5 * gap)
    assert widest(yard, START, np.array((1.0, 7.0)), most=0.9) is None


def test_an_empty_floor_parts_nothing_until_the_reach_is_half_of_it():
    assert widest([], most=3.9) is None


def test_on_random_floors_searches_agree_just_below_and_just_above():
    judged = parted = 0
    for seed in seeds(250):
        floor = random_floor(seed)
        places = random_places(floor, 2, seed)
        if len(places) < 2:
            continue
        ground = GrownFloor(floor.boundary, floor.obstacles)
        found = widest_reach(Rings.of(floor.obstacles, np.array(floor.boundary)), *places, 2.0)
        room = float(ground.distance(np.array(places)).min())
        # Ground is a little less than free between corners, and a little more by its slack.
        below = found and math.cos(0.5 * TURN_STEP) * found - 1e-4
        tried = [below, found + 1e-4] if found else [floor.reach]
        for reach in tried:
            if 0.01 < reach < room:
                judged += 1
                way = ground.fresh_ground(reach).shortest_way(*places, NO_DISCS)
                assert (way is None) == (found is not None and found < reach)
                parted += way is None
    assert judged > enough(60)
    assert parted > enough(10)
