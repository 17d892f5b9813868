"""Distances from the first part of a polyline, against a search through every leg."""

import numpy as np
import pytest

from sim.judging.polyline import Polyline


def distance(line, place):
    """Try every leg."""
    legs, to_place = np.diff(line, axis=0), place - line[:-1]
    square = np.maximum((legs**2).sum(axis=1), 1e-18)
    part = np.clip((legs * to_place).sum(axis=1) / square, 0.0, 1.0)
    return np.sqrt(((to_place - part[:, None] * legs) ** 2).sum(axis=1).min())


def walk(dice, count, bend):
    heading = np.cumsum(dice.normal(0.0, bend, count))
    steps = 0.01 * np.column_stack((np.cos(heading), np.sin(heading)))
    return np.vstack((np.zeros(2), np.cumsum(steps, axis=0)))


@pytest.mark.parametrize("count", [1, 2, 63, 64, 65, 700])
@pytest.mark.parametrize("bend", [0.0, 0.02, 0.3])
def test_the_distances_are_those_of_a_search_through_every_leg(count, bend):
    dice = np.random.default_rng(count)
    line = walk(dice, count, bend)
    at = dice.integers(0, count + 1, 60)
    away = np.where(np.arange(60) % 2, 0.002, 1.0)[:, None]
    places = line[at] + away * dice.normal(0.0, 1.0, (60, 2))
    until = dice.integers(1, count + 1, 60)
    expected = [distance(line[: n + 1], place) for n, place in zip(until, places, strict=True)]
    assert Polyline(line).distances(places, until) == pytest.approx(expected, abs=1e-12)


def test_many_places_are_looked_at_in_parts_and_none_give_nothing():
    line = walk(np.random.default_rng(0), 300, 0.05)
    places, until = np.vstack([line] * 4), np.tile(np.maximum(np.arange(301), 1), 4)
    assert np.abs(Polyline(line).distances(places, until)).max() < 1e-12
    assert len(Polyline(line).distances(places[:0], until[:0])) == 0


def test_legs_without_length_count_as_points():
    line = np.array([[1.0, 0.0]] * 3 + [[2.0, 0.0]])
    found = Polyline(line).distances(np.array([[1.0, 2.0], [2.0, 2.0]]), np.array([2, 3]))
    assert found == pytest.approx([2.0, 2.0])
