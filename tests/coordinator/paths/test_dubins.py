"""Ways from heading to heading, beside the shortest ones that a car could drive."""

import random

import pytest

from tests.coordinator.paths.test_end_headings import assert_turns_and_headings, curve_of
from tests.dubins import dubins_length
from tests.sweeps import seeds


@pytest.mark.parametrize("radius", [0.1, 0.3, 0.6])
def test_any_two_poses_near_each_other_are_joined_by_nearly_the_shortest_way(radius):
    ratios = []
    for seed in seeds(30):
        dice = random.Random(seed)
        start, goal = (
            (*(8.0 + dice.uniform(0.0, 6.0 * radius) for _ in "xy"), dice.uniform(-3.1, 3.1))
            for _ in range(2)
        )
        curve = curve_of(start, goal, radius)
        assert_turns_and_headings(curve, start, goal, radius)
        ratios.append(curve.length / dubins_length(start, goal, radius))
    ratios.sort()
    assert ratios[0] > 0.999
    assert ratios[len(ratios) // 2] < 1.15
    assert ratios[-1] < 2.0
