"""Boxes around stretches of paths never tell two paths farther apart than they are."""

import numpy as np
import pytest
import shapely

from coordinator.plan.course import Boxes, Course
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_scenario
from tests.scenarios import random_scenario
from tests.sweeps import seeds


@pytest.mark.parametrize("seed", seeds(12))
def test_no_path_is_told_farther_away_than_it_is(seed):
    driven = packed(plan_scenario(random_scenario(seed, clutter=0), effort=0)).driven
    boxes = Boxes([Course(one, 0.0) for one in driven])
    lines = [shapely.linestrings(one.chain.points) for one in driven]
    for one, line in zip(driven, lines, strict=True):
        told = boxes.apart(one.chain.points)
        bounds = [other.chain.bound for other in driven]
        true = np.array([shapely.distance(line, other) for other in lines]) - bounds
        assert (told <= true + 1e-9).all()
        assert boxes.radii.tolist() == [other.radius for other in driven]


def test_a_path_around_a_corner_is_far_from_what_lies_within():
    scenario = random_scenario(1, clutter=0)
    driven = packed(plan_scenario(scenario, effort=0)).driven
    boxes = Boxes([Course(one, 0.0) for one in driven])
    corner = np.array([(0.0, 0.0), *((x, 0.0) for x in range(1, 30)), (30.0, 30.0)])
    whole = np.array([corner.min(axis=0), corner.max(axis=0)])
    assert (boxes.apart(corner) >= boxes.apart(whole)).all()


def test_without_courses_there_are_no_distances():
    assert Boxes([]).apart(np.zeros((2, 2))).shape == (0,)
