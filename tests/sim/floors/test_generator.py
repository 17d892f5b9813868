import hashlib
import itertools
import json
import math
import os
import subprocess
import sys

import numpy as np
import pytest
import shapely
from scipy import ndimage
from scipy.spatial import cKDTree

from coordinator.scenario.checks import find_problems
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.scenario_files.toml_writer import scenario_to_toml
from sim.floors.generator import KINDS, OBSTACLES, generate
from sim.floors.polygons import polygon_floor
from tests.test_readme import ROOT

EVERY_KIND = pytest.mark.parametrize("kind", sorted(KINDS))
PLAIN = {}
RICH = {"headings": True, "vias": 1, "mixed": True}
BOTH = pytest.mark.parametrize("options", [PLAIN, RICH], ids=["plain", "rich"])
STEP = 0.05


def digests():
    """A digest per kind of everything a scenario says."""
    made = {kind: scenario_to_toml(generate(kind, 5, 4, **RICH)) for kind in sorted(KINDS)}
    return {kind: hashlib.sha256(text).hexdigest() for kind, text in made.items()}


def places(robot):
    return robot.start[:2], robot.goal[:2]


def shapes(scenario):
    return [shapely.Polygon(corners) for corners in scenario.workspace.obstacles]


def solid(scenario):
    """The obstacles and the floor's edge."""
    edge = shapely.LinearRing(scenario.workspace.boundary)
    return shapely.union_all([*shapes(scenario), edge])


@EVERY_KIND
@BOTH
def test_every_kind_makes_sound_scenarios_that_read_back_equal(kind, options):
    for count in (1, 2, 9):
        scenario = generate(kind, count, 3, **options)
        assert find_problems(scenario) == []
        assert [robot.id for robot in scenario.robots] == [f"R{i + 1}" for i in range(count)]
        assert parse_scenario(scenario_to_toml(scenario), "again.toml") == scenario


def test_another_process_makes_the_same_bytes():
    code = "import json, tests.sim.floors.test_generator as t; print(json.dumps(t.digests()))"
    environment = os.environ | {"PYTHONHASHSEED": "77"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT, env=environment, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert json.loads(done.stdout) == digests()


@EVERY_KIND
def test_another_seed_makes_another_scenario(kind):
    made = {
        (scenario.workspace, scenario.robots)
        for scenario in (generate(kind, 3, s) for s in range(4))
    }
    assert len(made) == 4


@EVERY_KIND
@BOTH
def test_places_keep_off_the_places_of_all_others(kind, options):
    scenario = generate(kind, 17, 5, **options)
    for a, b in itertools.combinations(scenario.robots, 2):
        for one, other in itertools.product(places(a), places(b)):
            assert math.dist(one, other) >= scenario.need(a, b) + 0.02
    largest = max(robot.radius for robot in scenario.robots)
    stops = [stop for robot in scenario.robots for stop in (*places(robot), *robot.via)]
    clear = shapely.distance(solid(scenario), shapely.points(stops))
    assert clear.min() >= largest + scenario.margin


def clearances(scenario, xs, ys):
    """Distances from points to walls, from points 2 cm apart on all outlines; 0 inside walls."""
    rings = [scenario.workspace.boundary, *scenario.workspace.obstacles]
    edges = shapely.segmentize([shapely.LinearRing(ring) for ring in rings], 0.02)
    clear, _ = cKDTree(shapely.get_coordinates(edges)).query(np.stack((xs, ys), axis=-1))
    floor, walls = shapely.Polygon(rings[0]), shapely.union_all(shapes(scenario))
    shapely.prepare([floor, walls])
    free = shapely.contains_xy(floor, xs, ys) & ~shapely.contains_xy(walls, xs, ys)
    return np.where(free, clear, 0.0)


@EVERY_KIND
@BOTH
def test_a_flood_from_each_start_reaches_the_goal_and_wets_no_other_place(kind, options):
    scenario = generate(kind, 5 if options else 11, 1, **options)
    low = np.min(scenario.workspace.boundary, axis=0)
    high = np.max(scenario.workspace.boundary, axis=0)
    xs, ys = np.meshgrid(
        *(np.arange(*side, STEP) for side in zip(low, high, strict=True)), indexing="ij"
    )
    clear = clearances(scenario, xs, ys)
    for robot in scenario.robots:
        free = clear >= robot.radius + scenario.margin
        for other in scenario.robots:
            for x, y in places(other) if other is not robot else ():
                free &= np.hypot(xs - x, ys - y) >= scenario.need(robot, other)
        wet, _ = ndimage.label(free, structure=np.ones((3, 3)))
        stops = np.array((*places(robot), *robot.via))
        labels = {wet[tuple(at)] for at in np.rint((stops - low) / STEP).astype(int)}
        assert len(labels) == 1
        assert 0 not in labels


@EVERY_KIND
def test_headings_lead_straight_out_of_the_start_and_into_the_goal(kind):
    scenario = generate(kind, 9, 6, headings=True)
    hard = solid(scenario)
    for robot in scenario.robots:
        others = [
            place for other in scenario.robots if other is not robot for place in places(other)
        ]
        for (x, y, heading), sense in ((robot.start, 1.0), (robot.goal, -1.0)):
            for step in np.linspace(0.0, 2.0 * robot.radius, 9):
                ahead = (
                    x + sense * step * math.cos(heading),
                    y + sense * step * math.sin(heading),
                )
                assert hard.distance(shapely.Point(ahead)) >= robot.radius + scenario.margin
                need = 2.0 * robot.radius + scenario.margin
                assert all(math.dist(ahead, other) >= need for other in others)


@EVERY_KIND
def test_the_floor_grows_with_the_number_of_robots(kind):
    for count in (3, 60):
        scenario = generate(kind, count, 1)
        free = shapely.Polygon(scenario.workspace.boundary).difference(
            shapely.union_all(shapes(scenario))
        )
        discs = sum(math.pi * robot.radius**2 for robot in scenario.robots)
        assert discs <= 0.08 * free.area


def test_a_thousand_robots_among_500_corners_are_placed_and_apart():
    scenario = generate("polygons", 1000, 1, obstacles=75)
    assert 400 <= sum(map(len, scenario.workspace.obstacles)) <= 600
    assert find_problems(scenario) == []
    spots = shapely.points([place for robot in scenario.robots for place in places(robot)])
    near = shapely.STRtree(spots).query(spots, predicate="dwithin", distance=0.47)
    assert near.shape[1] == len(spots)


@pytest.mark.parametrize("corners", [3, 14, 100, 500, 2000])
def test_a_polygon_floor_has_the_corners_asked_for_and_its_polygons_lie_apart(corners):
    floor = polygon_floor(corners, 7, (60.0, 50.0))
    assert floor == polygon_floor(corners, 7, (60.0, 50.0))
    assert sum(map(len, floor.obstacles)) == corners
    polygons = [shapely.Polygon(ring) for ring in floor.obstacles]
    assert all(
        polygon.is_valid and 3 <= len(polygon.exterior.coords) - 1 <= 12 for polygon in polygons
    )
    assert shapely.box(0, 0, 60, 50).contains(shapely.union_all(polygons))
    pairs = shapely.STRtree(polygons).query(polygons, predicate="dwithin", distance=0.05)
    assert pairs.shape[1] == len(polygons)


def test_polygons_come_convex_and_concave_apart_touching_and_overlapping():
    kinds = set()
    for seed in range(4):
        polygons = shapes(generate("polygons", 17, seed))
        kinds |= {polygon.equals(polygon.convex_hull) for polygon in polygons}
        for one, other in itertools.combinations(polygons, 2):
            if one.touches(other):
                kinds.add(one.intersection(other).geom_type)
            elif one.overlaps(other) or one.contains(other) or one.within(other):
                kinds.add("overlap")
    assert {True, False, "Point", "LineString", "overlap"} <= kinds


def test_blocked_cells_of_a_grid_share_edges_and_touch_at_corners():
    cells = shapes(generate("grid", 17, 0))
    touches = {
        one.intersection(other).geom_type
        for one, other in itertools.combinations(cells, 2)
        if one.intersects(other)
    }
    assert touches == {"LineString", "Point"}


@pytest.mark.parametrize("seed", range(5))
def test_every_room_of_a_house_can_be_reached(seed):
    for kind in ("rooms", "maze", "corridors"):
        scenario = generate(kind, 17, seed)
        floor = shapely.Polygon(scenario.workspace.boundary)
        free = floor.buffer(-0.25).difference(shapely.union_all(shapes(scenario)).buffer(0.25))
        large = [part for part in shapely.get_parts(free) if part.area > 0.5]
        assert len(large) == 1


def test_the_warehouse_of_the_paper_has_three_sorting_tables_and_trips_to_and_fro():
    scenario = generate("warehouse", 17, 3)
    tables = [shape for shape in shapes(scenario) if math.isclose(shape.area, 1.44, rel_tol=0.01)]
    hall = shapely.union_all(tables).buffer(1.5)
    at_tables = [[hall.contains(shapely.Point(place)) for place in places(robot)]
                 for robot in scenario.robots]  # fmt: skip
    assert len(tables) == 3
    assert all(start != goal for start, goal in at_tables)
    assert {start for start, _ in at_tables} == {True, False}


def test_the_straight_way_out_of_a_trap_is_blocked():
    scenario = generate("u-traps", 17, 2)
    traps = shapes(scenario)
    assert all(trap.area < 0.6 * trap.convex_hull.area for trap in traps)
    trapped = [
        robot
        for robot in scenario.robots
        for trap in traps
        if trap.convex_hull.contains(shapely.Point(robot.start[:2]))
        and trap.intersects(shapely.LineString(places(robot)))
    ]
    assert trapped


@pytest.mark.parametrize("count", [5, 6, 17, 50, 100])
def test_robots_on_a_circle_cross_its_middle(count):
    scenario = generate("circle", count, 1)
    x, y = np.array(scenario.workspace.boundary).mean(axis=0)
    middle = shapely.Point(x, y)
    radii = {
        round(middle.distance(shapely.Point(p)), 2) for r in scenario.robots for p in places(r)
    }
    assert len(radii) == 1
    for robot in scenario.robots:
        way = shapely.LineString(places(robot))
        assert way.distance(middle) <= (0.002 if count % 2 else 1.6 * max(radii) / count)


@pytest.mark.parametrize("count", [2, 5, 50, 200])
def test_robots_on_a_ring_all_go_round_the_island_the_same_way(count):
    scenario = generate("ring", count, 1)
    x, y = np.array(scenario.workspace.boundary).mean(axis=0)
    for robot in scenario.robots:
        start, goal = (math.atan2(place[1] - y, place[0] - x) for place in places(robot))
        assert 0.0 < (goal - start) % math.tau <= math.pi + 0.01


@pytest.mark.parametrize("kind", sorted(OBSTACLES))
def test_the_number_of_obstacles_can_be_chosen(kind):
    few, more = (generate(kind, 5, 1, (30.0, 25.0), obstacles=count) for count in (2, 3))
    assert few.workspace.boundary[2] == (30.0, 25.0)
    assert 0 < len(few.workspace.obstacles) < len(more.workspace.obstacles)
    assert find_problems(few) == find_problems(more) == []


def test_mixed_robots_differ_and_others_do_not():
    plain, mixed = generate("open", 30, 1), generate("open", 30, 1, mixed=True)
    assert len({(robot.radius, robot.max_speed, robot.max_accel) for robot in plain.robots}) == 1
    for field in ("radius", "max_speed", "max_accel"):
        assert len({getattr(robot, field) for robot in mixed.robots}) > 2
