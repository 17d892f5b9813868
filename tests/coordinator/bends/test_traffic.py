"""Where robots are and when: held against plain loops over all samples."""

from __future__ import annotations

import math
from random import Random

import numpy as np
import pytest

from coordinator.bends.traffic_kernels import (
    MOST,
    count_meetings,
    first_meeting,
    forbidden_at,
    free_from,
    gathered,
    least_delay,
)

TAU, REACH, SIZE = 0.7, 0.25, 0.6


def drive(start, goal, begin, speed, radius=0.2, step=0.1):
    """Return samples of a robot that drives straight from a time on, and rests before and after."""
    start, goal = np.array(start, float), np.array(goal, float)
    count = max(int(math.dist(start, goal) / step), 1)
    lasts = math.dist(start, goal) / speed / count
    rows = [(*start, -math.inf, begin, radius)]
    for k in range(count):
        x, y = start + (k + 0.5) / count * (goal - start)
        rows.append((x, y, begin + k * lasts, begin + (k + 1) * lasts, radius))
    return np.array([*rows, (*goal, begin + count * lasts, math.inf, radius)])


def crowd(seed, count=6):
    dice = Random(seed)

    def place():
        return dice.uniform(0.0, 5.0), dice.uniform(0.0, 5.0)

    return [drive(place(), place(), dice.uniform(0.0, 4.0), 0.7) for _ in range(count)]


def laid_out(parts):
    owner = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    return gathered(np.concatenate(parts), owner, -1.0, -1.0, SIZE, 12, 12)


def union(intervals):
    """Return overlapping intervals joined, in order."""
    joined = []
    for begin, end in sorted(intervals):
        if joined and begin <= joined[-1][1]:
            joined[-1][1] = max(joined[-1][1], end)
        else:
            joined.append([begin, end])
    return joined


def forbidding(parts, without, x, y):
    return union(
        (row[2] - TAU, row[3] + TAU)
        for index, part in enumerate(parts)
        if index != without
        for row in part
        if math.hypot(row[0] - x, row[1] - y) < REACH + row[4]
    )


@pytest.mark.parametrize("seed", range(12))
def test_times_forbidden_at_a_place_are_those_of_all_samples_near_it(seed):
    parts, dice = crowd(seed), Random(seed)
    traffic, found = laid_out(parts), np.empty((MOST, 2))
    for _ in range(50):
        x, y = dice.uniform(0.0, 5.0), dice.uniform(0.0, 5.0)
        count = forbidden_at(traffic, 0, x, y, REACH, TAU, found)
        expected = np.array(forbidding(parts, 0, x, y)).reshape(-1, 2)
        np.testing.assert_allclose(found[:count], expected)


def test_times_that_have_no_room_are_forbidden_for_ever():
    parts = [drive((0.0, 0.0), (0.1, 0.0), 50.0, 1.0)]
    parts += [np.array([[1.0, 1.0, 10.0 * k, 10.0 * k + 1.0, 0.2]]) for k in range(1, MOST + 5)]
    found = np.empty((MOST, 2))
    count = forbidden_at(laid_out(parts), 0, 1.0, 1.0, REACH, TAU, found)
    assert count == MOST
    assert found[-1, 1] == math.inf


@pytest.mark.parametrize("seed", range(12))
def test_a_place_is_free_for_ever_from_the_end_of_the_last_time_forbidden_there(seed):
    parts, dice = [part[:-1] for part in crowd(seed)], Random(seed)
    places = [(dice.uniform(0.0, 5.0), dice.uniform(0.0, 5.0)) for _ in range(50)]
    found = [free_from(laid_out(parts), 0, x, y, REACH, TAU) for x, y in places]
    closed = [forbidding(parts, 0, x, y) for x, y in places]
    expected = [times[-1][1] if times else -math.inf for times in closed]
    np.testing.assert_allclose(found, expected)
    assert -math.inf < max(expected) < math.inf


@pytest.mark.parametrize("seed", range(12))
def test_the_least_delay_is_the_first_one_that_meets_nobody(seed):
    parts = crowd(seed)
    traffic, own = laid_out(parts), parts[0].copy()
    own[0, 3] = 0.0
    own[1:, 2] -= parts[0][0, 3]
    own[1:-1, 3] -= parts[0][0, 3]

    def meets(delay):
        later = own.copy()
        later[1:, 2] += delay
        later[:-1, 3] += delay
        return first_meeting(later, traffic, 0, REACH, TAU) >= 0

    tried = np.arange(0.0, 40.0, 0.01)
    expected = next((delay for delay in tried if not meets(delay)), math.inf)
    assert least_delay(own, traffic, 0, REACH, TAU) == pytest.approx(expected, abs=0.011)


@pytest.mark.parametrize("seed", range(12))
def test_meetings_are_counted_by_pairs_of_samples(seed):
    parts = crowd(seed)
    expected = [
        sum(
            math.hypot(row[0] - own[0], row[1] - own[1]) < REACH + row[4]
            and row[2] - TAU < own[3]
            and own[2] < row[3] + TAU
            for own in parts[0]
            for row in part
        )
        for part in parts
    ]
    found = count_meetings(parts[0], laid_out(parts), 0, REACH, TAU, len(parts))
    assert found.tolist() == [0, *expected[1:]]
