"""Changing a path in one place: passed exactly, clear by sampling, and elsewhere bit for bit."""

import random

import numpy as np
import pytest

from coordinator.base.errors import PlanError
from coordinator.paths.path_planner import Pathfinder
from coordinator.scenario.model import Scenario, Workspace
from tests.coordinator.paths.test_smoothing import assert_c2, clear_by
from tests.floors import box, random_floor, random_places, solid_of
from tests.scenarios import a_robot, a_scenario

WALLS = [box(3, 0, 3.3, 5), box(6, 3, 6.3, 8), box(9, 0, 9.3, 5), box(12, 3, 12.3, 8)]


def long_scenario(**fields):
    return a_scenario([a_robot("A", (1, 1), (14, 1), **fields)], (15, 8), WALLS)


def agreement(old, new):
    """How many control points and knots at either end are the same, bit for bit."""
    counts = []
    for before, after in ((old.points, new.points), (old.knots[:, None], new.knots[:, None])):
        least = min(len(before), len(after))
        same = [np.all(a == b) for a, b in zip(before[:least], after[:least], strict=True)]
        back = [np.all(a == b) for a, b in zip(before[::-1], after[::-1], strict=False)]
        counts.append((same.index(False) if False in same else least, back.index(False)))
    return counts


def nearest(curve, place):
    points = curve.evaluate(np.linspace(0.0, curve.knots[-1], 200_001))
    return float(np.hypot(*(points - place).T).min())


@pytest.mark.parametrize(("via", "first"), [((2.0, 4.0), 0), ((7.5, 4.4), 1), ((13.2, 3.0), 2)])
def test_a_place_more_is_passed_exactly_and_the_rest_stays_as_it_was(via, first):
    finder = Pathfinder(long_scenario())
    old = finder.fit(0)
    new = finder.led_through(0, old, via)
    assert nearest(new.curve, via) < 1e-4
    assert_c2(new.curve)
    (points, points_back), (knots, knots_back) = agreement(old.curve, new.curve)
    assert points + points_back >= len(old.curve.points) - 9
    assert knots + knots_back >= len(old.curve.knots) - 9
    if first > 0:
        assert points > 3
    if first < 2:
        assert points_back > 3
    u = np.linspace(0.0, old.curve.knots[knots - 1], 500)
    kept = u[u < old.curve.knots[max(points - 1, 0)]]
    np.testing.assert_array_equal(new.curve.evaluate(kept), old.curve.evaluate(kept))


@pytest.mark.parametrize(
    ("goal", "changed"),
    [((13.6, 1.6), 9), ((14.3, 0.6), 9), ((13.0, 6.5), 13), ((14.2, 7.5), 13)],
)
def test_another_goal_changes_only_the_end(goal, changed):
    finder = Pathfinder(long_scenario())
    old = finder.fit(0)
    new = finder.led_to(0, old, goal)
    np.testing.assert_allclose(new.curve.points[-1], goal, atol=1e-6)
    assert_c2(new.curve)
    (points, _), (knots, _) = agreement(old.curve, new.curve)
    assert points >= len(old.curve.points) - changed
    assert knots >= len(old.curve.knots) - changed


def test_several_changes_follow_each_other():
    finder = Pathfinder(long_scenario())
    found = finder.fit(0)
    for via in ((2.0, 4.0), (10.6, 4.5), (7.5, 4.4)):
        found = finder.led_through(0, found, via)
    found = finder.led_to(0, found, (13.5, 2.0))
    for via in ((2.0, 4.0), (10.6, 4.5), (7.5, 4.4)):
        assert nearest(found.curve, via) < 1e-4
    assert_c2(found.curve)


def test_headings_at_the_ends_outlive_a_change():
    finder = Pathfinder(headed_scenario())
    found = finder.led_through(0, finder.fit(0), (7.5, 4.4))
    for end, heading in ((0.0, 0.5), (found.curve.knots[-1], -0.7)):
        along = found.curve.derivatives([end], 1)[1][0]
        assert np.arctan2(along[1], along[0]) == pytest.approx(heading, abs=1e-3)


def headed_scenario():
    return a_scenario([a_robot("A", (1, 1, 0.5), (14, 1, -0.7))], (15, 8), WALLS)


def test_a_place_inside_something_is_refused_with_the_robots_name():
    finder = Pathfinder(long_scenario())
    found = finder.fit(0)
    with pytest.raises(PlanError, match=r"^A: "):
        finder.led_through(0, found, (3.1, 2.0))
    with pytest.raises(PlanError, match=r"^A: "):
        finder.led_to(0, found, (6.1, 5.0))


def test_changed_paths_are_clear_on_random_floors():
    changed = 0
    for seed in range(60):
        floor, dice = random_floor(seed), random.Random(seed)
        places = random_places(floor, 3, seed, on_walls=0.0)
        if len(places) < 3:
            continue
        robot = a_robot("A", tuple(places[0]), tuple(places[1]), radius=0.6 * floor.reach)
        scenario = a_scenario_on(floor, robot)
        finder = Pathfinder(scenario)
        try:
            old = finder.fit(0)
            base = old.curve.at_arc(dice.uniform(0.2, 0.8) * old.curve.length)[0]
            via = tuple(base + np.array([dice.uniform(-0.5, 0.5), dice.uniform(-0.5, 0.5)]))
            new = finder.led_through(0, old, via)
        except PlanError:
            continue
        changed += 1
        assert nearest(new.curve, via) < 2e-4
        assert clear_by(new.curve, solid_of(floor), floor.reach - 3e-6)
    assert changed >= 25


def a_scenario_on(floor, robot):
    obstacles = tuple(tuple(ring) for ring in floor.obstacles)
    workspace = Workspace(boundary=tuple(floor.boundary), obstacles=obstacles)
    margin = 0.4 * floor.reach
    return Scenario(name="t", workspace=workspace, robots=(robot,), margin=margin)
