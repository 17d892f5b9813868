"""Distances to obstacles and to the edge of the floor, against motions whose truth is known."""

import numpy as np
import pytest
import shapely

from coordinator.planning.planner import plan_scenario
from sim.campaigns.truth import SOLID, obstacle_touches
from sim.judging.blackbox import BlackBox
from sim.judging.clearance import SolidGround
from sim.world.fault_text import Fault
from tests.scenarios import a_robot, a_scenario

FLOOR = ((0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0))
BLOCK = ((4.0, 3.0), (6.0, 3.0), (6.0, 5.0), (4.0, 5.0))


def box(*places, times=None):
    t = np.arange(len(places), dtype=float) if times is None else np.array(times)
    return BlackBox(t, np.array(places, dtype=float), 0.0 * t, ("moving",) * len(places))


def test_the_corner_that_is_passed_between_two_rows_counts():
    solid = SolidGround(FLOOR, [BLOCK])
    apart, t = solid.nearest(box((1.0, 5.5), (3.0, 5.5), (7.0, 5.5), (9.0, 5.5)))
    assert (apart, t) == (pytest.approx(0.5), 1.0)


def test_a_robot_that_stands_is_as_far_away_as_its_place():
    solid = SolidGround(FLOOR, [BLOCK])
    assert solid.nearest(box((3.5, 4.0))) == (pytest.approx(0.5), 0.0)
    assert solid.nearest(box((3.5, 4.0), (3.5, 4.0), times=[2.0, 9.0]))[0] == pytest.approx(0.5)


def test_the_edge_of_the_floor_is_solid():
    solid = SolidGround(FLOOR, [])
    assert solid.nearest(box((5.0, 4.0), (9.7, 4.0), (5.0, 4.0)))[0] == pytest.approx(0.3)


@pytest.mark.parametrize(
    "places",
    [
        [(3.0, 4.0), (7.0, 4.0)],
        [(4.5, 4.0), (5.5, 4.0)],
        [(5.0, 4.0)],
        [(9.0, 4.0), (11.0, 4.0)],
        [(12.0, 4.0), (12.0, 5.0)],
    ],
    ids=["through", "within", "rests within", "off the floor", "beyond the floor"],
)
def test_what_is_in_something_solid_has_no_distance_left(places):
    assert SolidGround(FLOOR, [BLOCK]).nearest(box(*places))[0] == 0.0


def test_the_least_distance_is_what_fine_sampling_finds():
    random = np.random.default_rng(7)
    for _ in range(20):
        corners = random.uniform(2.0, 8.0, (3, 2))
        places = random.uniform(0.5, 7.5, (6, 2))
        fine = np.column_stack(
            [np.interp(np.linspace(0.0, 5.0, 20_001), np.arange(6), places[:, i]) for i in (0, 1)]
        )
        block, floor = shapely.Polygon(corners), shapely.Polygon(FLOOR)
        points = shapely.points(fine)
        sampled = np.minimum(
            shapely.distance(block, points), shapely.distance(floor.exterior, points)
        ).min()
        found = SolidGround(FLOOR, [corners]).nearest(box(*places))[0]
        assert sampled - 0.002 <= found <= sampled + 1e-9


def test_a_campaign_tells_who_touched_something_solid_but_for_what_a_fault_made_it_slide():
    hall = a_scenario(
        [a_robot("R1", (1.0, 1.0), (9.0, 1.0)), a_robot("R2", (1.0, 7.0), (9.0, 7.0))]
    )
    document = plan_scenario(hall, effort=0)
    radius = document.robots[0].radius
    boxes = {"R1": box((1.0, 1.0), (5.0, 0.9 * radius)), "R2": box((1.0, 7.0), (9.0, 7.0))}
    (found,) = obstacle_touches(document, boxes)
    assert (found.a, found.b, found.t) == ("R1", SOLID, 0.0)
    assert found.separation == pytest.approx(0.9 * radius)
    assert found.text().startswith("R1 and something solid touch at 0.00 s")
    assert obstacle_touches(document, boxes, [Fault("skid", "R1", 0.5, -0.2 * radius)]) == []
    assert obstacle_touches(document, {**boxes, "R1": box((1.0, 1.0))}) == []
