"""Bendy ways: told with fewer numbers where a message has no room, and unchanged where it has."""

import math

import numpy as np
import pytest
import shapely

from coordinator.curves.nurbs import nurbs
from coordinator.motion import velocity_profile as motion
from coordinator.motion.message_room import ROOM, path_bytes, speed_bytes
from coordinator.motion.velocity_profile import Motion, limits_on
from coordinator.paths import smoothing
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from protocol.messages import MAX_MESSAGE_BYTES
from tests.oracles import complaints
from tests.scenarios import a_robot, a_scenario, box

SPACING, HEIGHT = 1.5, 6.0


def serpentine(walls, lateral=math.inf):
    """A robot alone among thin walls that it goes around one after another, up and down."""
    shapes = []
    for i in range(walls):
        x, low = SPACING * (i + 1) - 0.1, 0.0 if i % 2 else SPACING
        shapes.append(box(x, low, x + 0.2, low + HEIGHT - SPACING))
    width = SPACING * (walls + 1)
    robot = a_robot(
        "A", (0.7, 3.0), (width - 0.7, 3.0), max_accel=lateral, max_lateral_accel=lateral
    )
    return a_scenario([robot], size=(width, HEIGHT), obstacles=shapes)


def zigzag(vias):
    places = tuple((1.0 + 18.0 * i / vias, 2.0 + 2.0 * (i % 2)) for i in range(vias))
    robot = a_robot("A", (0.5, 1), (19.5, 1), via=places, max_accel=0.3)
    return a_scenario([robot], size=(20, 8))


@pytest.mark.parametrize("lateral", [math.inf, 0.3])
@pytest.mark.parametrize("walls", [14, 26])
def test_a_way_around_many_walls_fits_a_message(walls, lateral):
    scenario = serpentine(walls, lateral)
    document = plan_scenario(scenario)
    assert complaints(to_json(document), scenario) == []
    assert document.robots[0].wire_bytes <= MAX_MESSAGE_BYTES


def test_a_way_with_fewer_corners_stays_clear_and_is_hardly_longer():
    scenario = serpentine(26)
    curve = Pathfinder(scenario).path(0)
    assert path_bytes(len(curve.points)) <= ROOM
    shortest = 2 * 25 * (HEIGHT - 2 * SPACING)
    assert curve.length < 1.5 * shortest
    places = shapely.points(curve.at_arc(np.linspace(0.0, curve.length, 20_000)))
    reach = scenario.robots[0].radius + scenario.margin - 1e-5
    for shape in scenario.workspace.obstacles:
        assert not shapely.dwithin(shapely.Polygon(shape), places, reach).any()


@pytest.mark.parametrize(("walls", "same"), [(10, True), (12, True), (14, False)])
def test_a_way_that_fits_is_what_it_was(walls, same, monkeypatch):
    found = Pathfinder(serpentine(walls)).path(0)
    monkeypatch.setattr(smoothing, "_SPENT_PER_CORNER", ())
    assert np.array_equal(found.points, Pathfinder(serpentine(walls)).path(0).points) == same


def test_a_way_over_many_via_points_fits_with_fewer_speed_knots():
    scenario = zigzag(40)
    document = plan_scenario(scenario)
    assert complaints(to_json(document), scenario) == []
    assert document.robots[0].wire_bytes <= MAX_MESSAGE_BYTES


def test_fewer_speed_knots_keep_all_limits(monkeypatch):
    count = 190
    curve = a_winding_curve(count)
    limits = limits_on(curve, 1.5, 0.3, 0.3)
    s, w = np.array(limits.bends).T
    assert path_bytes(count) + speed_bytes(len(s), len(np.unique(w))) <= ROOM
    u = np.linspace(0.0, curve.knots[-1], 50_001)
    allowed = np.minimum(0.3 / np.maximum(np.abs(curve.curvature(u)), 1e-9), 2.25)
    assert (np.interp(curve.arc_at(u), s, w) <= allowed + 1e-9).all()
    assert np.abs(np.diff(w) / np.diff(s)).max() <= 2.0 * 0.3 * (1.0 + 1e-9)
    monkeypatch.setattr(motion, "ROOM", 100 * ROOM)
    fastest = limits_on(curve, 1.5, 0.3, 0.3)
    assert len(fastest.bends) > len(limits.bends)
    assert Motion(limits, []).finish < 1.25 * Motion(fastest, []).finish


def a_winding_curve(count):
    dice = np.random.default_rng(0)
    points = np.column_stack((np.arange(count), np.cumsum(dice.uniform(-1.0, 1.0, count))))
    knots = np.concatenate(([0.0] * 3, np.arange(count - 2), [count - 3.0] * 3))
    return nurbs(3, knots, points)


def test_a_way_with_more_different_bends_than_a_message_has_speeds_is_told_with_fewer(monkeypatch):
    """There is room for the bytes of all speeds, but not for as many different ones."""
    monkeypatch.setattr(motion, "MOST_SPEEDS", 20)
    curve = Pathfinder(serpentine(3)).path(0)
    s = np.linspace(0.0, curve.length, 200)
    w = 0.2 + 0.1 * np.sin(np.arange(200.0)) ** 2
    assert len(np.unique(w)) > 100
    fewer = motion._few(curve, s, w)[1]
    assert len(np.unique(fewer)) <= 20
    assert fewer.max() <= w.max()
