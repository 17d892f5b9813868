"""Where there is no way: who is shut in, by what, and what would help."""

import math
import re
import time

import numpy as np
import pytest
import shapely

from coordinator.base.errors import PlanError
from coordinator.ground.enclosure import NoWayError, explain
from coordinator.ground.free_space import NO_DISCS, Space
from coordinator.ground.grown_floor import GrownFloor
from coordinator.paths.path_planner import Pathfinder
from coordinator.scenario.model import MapPart, Scenario, Workspace
from tests.floors import box, random_floor, random_places, solid_of
from tests.oracles_floor import VisibilityGraph, convex_corners, grown
from tests.scenarios import a_robot
from tests.sweeps import enough, seeds

BOX = box(0, 0, 10, 8)
MARGIN = 0.02
YARD = [box(5, 2, 9, 2.3), box(5, 5.7, 9, 6), box(5, 2, 5.3, 6), box(8.7, 2, 9, 6)]


def refusal(robots, obstacles, boundary=BOX, part=None):
    workspace = Workspace(
        boundary=tuple(boundary),
        obstacles=tuple(tuple(ring) for ring in obstacles),
        from_map=part,
    )
    finder = Pathfinder(
        Scenario(name="t", workspace=workspace, robots=tuple(robots), margin=MARGIN)
    )
    with pytest.raises(PlanError) as caught:
        finder.path(0)
    return str(caught.value)


def named(text):
    return {int(number) for number in re.findall(r"workspace.obstacles\[(\d+)\]", text)}


@pytest.mark.parametrize("turned", [False, True])
def test_an_enclosed_place_is_told_with_the_walls_around_it(turned):
    ends = ((1.0, 4.0), (7.0, 4.0))
    robot = a_robot("A7", *(ends[::-1] if turned else ends))
    text = refusal([robot], [box(1, 6, 2, 7), *YARD])
    assert text.startswith("A7: has no way from (")
    assert "radius 0.2 m + margin 0.02 m" in text
    assert named(text) == {1, 2, 3, 4}
    assert "close it in" in text


def test_what_closes_a_corner_of_the_floor_names_its_edge():
    text = refusal([a_robot("A", (1.0, 1.0), (8.0, 7.0))], [box(0, 3, 4, 3.2), box(4, 0, 4.2, 3.2)])
    assert named(text) == {0, 1}
    assert "the floor's edge" in text


def test_a_long_list_is_cut_short():
    ring = [
        (7 + 2 * math.cos(k * math.pi / 8), 4 + 2 * math.sin(k * math.pi / 8)) for k in range(16)
    ]
    text = refusal(
        [a_robot("A", (1.0, 4.0), (7.0, 4.0))],
        [box(x - 0.3, y - 0.3, x + 0.3, y + 0.3) for x, y in ring],
    )
    assert len(named(text)) == 4
    assert "and 12 more close it in" in text


def test_walls_that_a_map_brought_are_told_by_its_file_and_a_place_at_them():
    start, goal = np.array((1.0, 4.0)), np.array((7.0, 4.0))
    floor = GrownFloor(BOX, [box(1, 6, 2, 7), *YARD])
    error = NoWayError(Space(floor.ground(0.22), 0.22), start, goal)
    robot = a_robot("A", (1.0, 4.0), (7.0, 4.0))
    text = str(explain(error, floor, robot, MARGIN, MapPart(file="yard.map", first=2)))
    assert named(text) == {1}
    places = re.findall(r"the obstacle of yard\.map at \((\S+), (\S+)\) m", text)
    assert len(places) == 3
    for wall, place in zip(YARD[1:], places, strict=True):
        assert shapely.distance(shapely.Polygon(wall), shapely.Point(*map(float, place))) < 0.01


@pytest.mark.parametrize("door", [0.2, 0.3, 0.4])
def test_the_radius_that_would_pass_does_pass_and_one_a_little_larger_does_not(door):
    walls = [box(0, 3, 5, 5), box(5 + door, 3, 10, 5)]
    text = refusal([a_robot("A", (5.0, 1.0), (5.0, 7.0), radius=0.3)], walls)
    fits = float(re.search(r"a radius of (\d+\.\d+) m would pass", text)[1])
    assert fits == pytest.approx(0.5 * door - MARGIN, abs=1e-9)
    workspace = Workspace(boundary=tuple(BOX), obstacles=tuple(tuple(ring) for ring in walls))
    slim = a_robot("A", (5.0, 1.0), (5.0, 7.0), radius=fits)
    again = Scenario(name="t", workspace=workspace, robots=(slim,), margin=MARGIN)
    assert Pathfinder(again).path(0).length > 6.0


@pytest.mark.parametrize("doors", [(0.4, 0.3), (0.3, 0.4)])
def test_the_radius_that_would_pass_does_so_on_the_whole_way(doors):
    walls = [
        box(*ends) for y, door in zip((2, 5), doors, strict=True)
        for ends in ((0, y, 5, y + 1), (5 + door, y, 10, y + 1))
    ]  # fmt: skip
    text = refusal([a_robot("A", (5.1, 1.0), (5.1, 7.0), radius=0.3, via=((5.1, 4.0),))], walls)
    assert text.endswith("a radius of 0.130 m would pass")


def test_where_no_radius_passes_another_goal_is_advised():
    text = refusal([a_robot("A", (1.0, 4.0), (7.0, 4.0))], YARD)
    assert "another goal or fewer obstacles would help" in text


@pytest.mark.parametrize("closed", ["start", "via point", "goal"])
def test_another_place_is_advised_for_that_which_is_closed_in(closed):
    inside, outside = (7.0, 4.0), ((1.0, 4.0), (1.0, 7.0))
    start, via, goal = {
        "start": (inside, (), outside[0]),
        "via point": (outside[0], (inside,), outside[1]),
        "goal": (outside[0], (), inside),
    }[closed]
    text = refusal([a_robot("A", start, goal, via=via)], YARD)
    assert text.endswith(f"; another {closed} or fewer obstacles would help")


def test_refusals_on_random_floors_are_right_and_name_what_is_near():
    refused = 0
    for seed in seeds(300):
        floor = random_floor(seed)
        places, reach = random_places(floor, 2, seed), floor.reach
        ground = GrownFloor(floor.boundary, floor.obstacles).ground(reach)
        if len(places) < 2 or ground.shortest_way(*places, NO_DISCS) is not None:
            continue
        refused += 1
        graph = VisibilityGraph(grown(floor, reach - 1e-6), convex_corners(grown(floor, reach)))
        assert graph.length(*places) == math.inf
        robot = a_robot("R1", *map(tuple, places), radius=reach - MARGIN)
        text = refusal([robot], floor.obstacles, floor.boundary)
        assert text.startswith("R1: has no way from (")
        room = shapely.Polygon(floor.boundary) - shapely.buffer(solid_of(floor), reach)
        pieces = shapely.get_parts(room)
        around = [
            pieces[np.argmin(shapely.distance(pieces, shapely.Point(place)))] for place in places
        ]
        if around[0] is not around[1]:
            assert "close it in" in text
            for number in named(text):
                shape = shapely.Polygon(floor.obstacles[number])
                assert shapely.distance(around, shape).min() < 1.2 * reach + 0.02
    assert refused >= enough(5)


def test_where_only_places_of_others_are_in_the_way_no_radius_is_advised():
    floor = GrownFloor(BOX, [])
    discs = np.array([(7.0 + math.cos(a), 4.0 + math.sin(a), 0.5) for a in range(7)])
    error = NoWayError(Space(floor.ground(0.22), 0.22, 0.0, discs), *np.array(((1, 4.0), (7, 4))))
    text = str(explain(error, floor, a_robot("A", (1, 4), (7, 4)), MARGIN))
    assert text.endswith("other starts or goals would help")


def test_what_helps_among_thousands_of_corners_is_found_in_a_moment():
    dice = np.random.default_rng(1)
    spots = [(x, y) for x in range(2, 60, 2) for y in range(2, 60, 2)]
    stars = [
        [
            (x + r * math.cos(a), y + r * math.sin(a))
            for a, r in zip(np.arange(0.0, 6.0, 0.9), dice.uniform(0.2, 0.6, 7), strict=True)
        ]
        for x, y in spots
    ]
    walls = [box(40.9, 2, 41.1, 60), box(40.9, 0, 41.1, 1.7)]
    stars = [star for star in stars if shapely.Polygon(star).disjoint(shapely.box(40, 0, 42, 60))]
    begin = time.process_time()
    floor = GrownFloor(box(0, 0, 60, 60), [*stars, *walls])
    ground = floor.ground(0.25)
    grown = time.process_time() - begin
    error = NoWayError(Space(ground, 0.25), *np.array(((1.0, 1.0), (59.0, 1.0))))
    robot = a_robot("A", (1.0, 1.0), (59.0, 1.0))
    explain(error, floor, robot, 0.05)
    begin = time.process_time()
    text = str(explain(error, floor, robot, 0.05))
    assert time.process_time() - begin < 25.0 * grown
    assert text.endswith("a radius of 0.100 m would pass")


def test_a_place_off_the_floor_is_told_as_such():
    start, goal = np.array((99.0, 4.0)), np.array((7.0, 4.0))
    floor = GrownFloor(BOX, [])
    error = NoWayError(Space(floor.ground(0.22), 0.22), start, goal)
    text = str(explain(error, floor, a_robot("A", (1.0, 4.0), (7.0, 4.0)), MARGIN))
    assert "for radius 0.2 m + margin 0.02 m: (99.00, 4.00) is off the floor" in text
