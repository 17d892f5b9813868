"""Staircases of courses that come and go, held against those that should be left."""

import random

import numpy as np
import pytest

from coordinator.plan.course_staircases import CourseStaircases
from coordinator.plan.staircases import NO_STAIRCASES
from tests.coordinator.schedule.test_authority import TAU, random_staircases
from tests.sweeps import seeds


def listed(staircases, courses):
    """Every staircase with the courses that it is about, by the one behind."""
    return sorted(
        (
            courses[staircases.behind[pair]],
            courses[staircases.ahead[pair]],
            staircases.knots_of(pair).tolist(),
        )
        for pair in range(len(staircases.ahead))
    )


@pytest.mark.parametrize("seed", seeds(40))
def test_a_course_has_the_staircases_that_were_put_last_and_the_others_keep_theirs(seed):
    dice = random.Random(seed)
    first = random_staircases(dice, 10)
    table, rows = CourseStaircases(first), listed(first, range(10))
    for _ in range(12):
        found, course = random_staircases(dice, 4), dice.randrange(20)
        courses = [course, *dice.sample([n for n in range(20) if n != course], 3)]
        if dice.random() < 0.3:
            courses[3] = -1
        table.put(course, found, courses)
        rows = [row for row in rows if course not in row[:2]]
        rows += [row for row in listed(found, courses) if -1 not in row[:2]]
        assert listed(table.all, range(20)) == sorted(rows)
        assert (np.diff(table.all.behind) >= 0).all()
        assert table.all.tau_ms == TAU
    for course in range(20):
        table.put(course, NO_STAIRCASES, ())
    assert len(table.all.ahead) == len(table.all.at) == 0
