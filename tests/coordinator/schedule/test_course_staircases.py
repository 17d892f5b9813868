"""Staircases of courses that come and go, held against those that should be left."""

import random

import numpy as np
import pytest

from coordinator.schedule.course_staircases import CourseStaircases
from tests.coordinator.schedule.test_authority import TAU, random_staircases
from tests.sweeps import seeds


def listed(staircases, robots, courses):
    """Every staircase with the robots and courses that it is about."""
    return [
        (
            robots[staircases.ahead[pair]],
            robots[staircases.behind[pair]],
            courses[staircases.ahead[pair]],
            courses[staircases.behind[pair]],
            staircases.knots_of(pair).tolist(),
        )
        for pair in range(len(staircases.ahead))
    ]


def sorted_by_robots(rows):
    return sorted((behind, ahead, knots) for ahead, behind, _, _, knots in rows)


@pytest.mark.parametrize("seed", seeds(40))
def test_what_is_left_is_what_was_added_and_not_dropped(seed):
    dice, table, rows = random.Random(seed), CourseStaircases(TAU), []
    for number in range(8):
        found = random_staircases(dice, 4)
        robots = dice.sample(range(20), 4)
        courses = [10 * number + k for k in range(4)]
        table.add(found, robots, courses)
        rows += listed(found, robots, courses)
        if dice.random() < 0.5:
            over = {row[2] for row in dice.sample(rows, min(2, len(rows)))}
            table.drop(over)
            rows = [row for row in rows if not over & {row[2], row[3]}]
        same = list(range(20))
        assert sorted_by_robots(listed(table.all, same, same)) == sorted_by_robots(rows)
        assert (np.diff(table.all.behind) >= 0).all()
        assert table.all.tau_ms == TAU
    table.drop({row[2] for row in rows} | {row[3] for row in rows})
    assert len(table.all.ahead) == len(table.all.at) == 0
