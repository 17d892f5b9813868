"""Pathfinder: a proven path or a sentence, whatever robots are asked for."""

import math
import random
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import shapely

from coordinator.base.errors import PlanError
from coordinator.curves.chords import chords_of
from coordinator.curves.nurbs import Nurbs
from coordinator.paths.path_planner import Pathfinder, find_paths
from coordinator.scenario.checks import find_problems
from coordinator.scenario.model import Robot, Scenario, Workspace
from sim.floors.generator import generate
from tests.floors import box, random_floor, random_places, solid_of
from tests.scenarios import a_robot
from tests.sweeps import seeds

BOX = box(0, 0, 10, 8)
MARGIN = 0.02
FLOAT32 = 2.5e-6
"""What the numbers of the wire may take from the clearance of a robot that stands flush [m]."""


def a_scenario(robots, obstacles=(), boundary=BOX, check=True):
    workspace = Workspace(
        boundary=tuple(boundary), obstacles=tuple(tuple(ring) for ring in obstacles)
    )
    scenario = Scenario(name="t", workspace=workspace, robots=tuple(robots), margin=MARGIN)
    assert not check or find_problems(scenario) == []
    return scenario


def path_of(robots, obstacles=(), index=0, **fields):
    return Pathfinder(a_scenario(robots, obstacles, **fields)).path(index)


def sampled(curve, count=3001):
    return curve.evaluate(np.linspace(0.0, curve.knots[-1], count))


def least_gap(curve, area):
    return float(shapely.distance(area, shapely.LineString(sampled(curve))))


def asked_at_random(seed):
    """A floor with up to five robots: headings, via points, wide turns, each other's places."""
    floor, dice = random_floor(seed), random.Random(seed)
    places = [tuple(place) for place in random_places(floor, 15, seed)]
    robots = []
    while len(places) >= 4 and len(robots) < dice.randint(2, 5):
        start, goal = places.pop(), places.pop()
        via = tuple(places.pop() for _ in range(dice.choice((0, 0, 1, 2))))
        start += (dice.uniform(-4, 4),) if dice.random() < 0.4 else ()
        goal += (dice.uniform(-4, 4),) if dice.random() < 0.4 else ()
        speed = dice.uniform(0.3, 1.5)
        robots.append(
            Robot(
                id=f"R{len(robots)}", start=start, goal=goal, via=via, max_speed=speed,
                radius=floor.reach - MARGIN, max_accel=dice.choice((speed, 0.2, math.inf)),
                max_lateral_accel=dice.choice((speed, 0.1, math.inf)),
                min_turn_radius=dice.choice((0.0, 0.0, 0.0, 0.05, 0.3)),
            )
        )  # fmt: skip
    return floor, robots


@pytest.mark.parametrize("part", seeds(6))
def test_several_hundred_random_robots_get_a_sound_path_or_a_sentence(part):
    found = {"path": 0, "sentence": 0}
    for seed in range(35 * part, 35 * part + 35):
        floor, robots = asked_at_random(seed)
        finder = Pathfinder(a_scenario(robots, floor.obstacles, floor.boundary, check=False))
        solid = solid_of(floor)
        for index, robot in enumerate(robots):
            answer = path_or_sentence(finder, index)
            if isinstance(answer, str):
                assert answer.startswith(f"{robot.id}: ")
                assert "\n" not in answer
                found["sentence"] += 1
            else:
                assert_sound(answer, robot, solid, floor.reach)
                found["path"] += 1
    assert min(found.values()) > 10


def path_or_sentence(finder, index):
    try:
        return finder.path(index)
    except PlanError as error:
        return str(error)


def assert_sound(curve, robot, solid, reach):
    assert isinstance(curve, Nurbs)
    u = np.linspace(0.0, curve.knots[-1], 2001)
    places, first, _ = curve.derivatives(u, 2)
    assert not shapely.dwithin(solid, shapely.points(places), reach - FLOAT32).any()
    for pose, place, along in (
        (robot.start, places[0], first[0]),
        (robot.goal, places[-1], first[-1]),
    ):
        assert math.dist(place, pose[:2]) < 1e-5
        assert np.hypot(*along) > 0.1
        if len(pose) == 3:
            turn = math.atan2(along[1], along[0]) - pose[2]
            assert abs(math.remainder(turn, math.tau)) < 1e-3
    if robot.min_turn_radius > 0.0:
        assert np.abs(curve.curvature(u)).max() * robot.min_turn_radius < 1.002
    assert np.hypot(*first.T).min() > 1e-3
    for numbers in (curve.knots, curve.points):
        np.testing.assert_array_equal(numbers, numbers.astype(np.float32))


@pytest.mark.parametrize("seed", seeds(25))
def test_gentle_via_points_are_passed_to_a_millimetre(seed):
    dice = random.Random(seed)
    via = ((dice.uniform(3, 4), dice.uniform(1, 7)), (dice.uniform(6, 7), dice.uniform(1, 7)))
    limits = {"max_lateral_accel": dice.choice((0.1, 1.0, math.inf))}
    curve = path_of([a_robot("A", (0.5, 4.0), (9.5, 4.0), via=via, **limits)])
    for place in via:
        assert np.hypot(*(sampled(curve, 200_001) - place).T).min() < 1e-3


def test_two_boxes_that_share_an_edge_are_passed_around_and_not_along_the_seam():
    boxes = [box(3, 2, 5, 6), box(5, 2, 7, 6)]
    curve = path_of([a_robot("A", (5.0, 1.0), (5.0, 7.0))], boxes)
    assert least_gap(curve, shapely.box(3, 2, 7, 6)) > 0.22 - FLOAT32
    with pytest.raises(PlanError, match=r"^A: has no way"):
        path_of([a_robot("A", (5.0, 1.0), (5.0, 7.0))], [box(0, 3, 5, 5), box(5, 3, 10, 5)])


def test_overlapping_polygons_are_passed_around_their_union():
    shapes = [box(3, 2, 6, 5), [(4, 3), (7.5, 3), (5, 6.5)], box(4, 1.5, 5, 5.5)]
    curve = path_of([a_robot("A", (1.0, 4.0), (9.0, 4.0))], shapes)
    union = shapely.union_all([shapely.Polygon(ring) for ring in shapes])
    assert least_gap(curve, union) > 0.22 - FLOAT32


def test_cells_that_touch_at_their_corners_block():
    cells = [box(k, 3 + k % 2, k + 1, 4 + k % 2) for k in range(10)]
    tiny = a_robot("A", (5.0, 1.0), (5.0, 7.0), radius=0.001)
    with pytest.raises(PlanError, match=r"^A: has no way"):
        path_of([tiny], cells)


def test_a_start_inside_an_obstacle_never_gets_a_way_out():
    inside = a_robot("A", (5.0, 4.0), (9.0, 4.0))
    with pytest.raises(PlanError, match=r"^A: "):
        path_of([inside], [box(4, 3, 6, 5)], check=False)
    problems = find_problems(a_scenario([inside], [box(4, 3, 6, 5)], check=False))
    assert any("inside workspace.obstacles[0]" in problem for problem in problems)


def test_an_enclosed_goal_is_refused_with_the_names_of_what_encloses_it():
    walls = [box(5, 2, 9, 2.3), box(5, 5.7, 9, 6), box(5, 2, 5.3, 6), box(8.7, 2, 9, 6)]
    with pytest.raises(
        PlanError, match=r"^A: has no way .* workspace\.obstacles\[0\] .*close it in"
    ):
        path_of([a_robot("A", (1.0, 4.0), (7.0, 4.0))], walls)


def test_robots_that_stand_flush_with_walls_get_paths():
    wall = [box(4, 0, 5, 6)]
    reach = 0.2 + MARGIN
    flush = a_robot("A", (4 - reach, 1.0), (5 + reach, 1.0))
    assert least_gap(path_of([flush], wall), shapely.box(4, 0, 5, 6)) > reach - FLOAT32
    corridor = a_robot("A", (1.0, reach), (9.0, reach))
    assert path_of([corridor], []).length == pytest.approx(8.0, abs=1e-5)


def test_paths_keep_off_the_places_of_others_where_there_is_a_way_around():
    others = [a_robot("B", (5.0, 4.0), (5.0, 7.0)), a_robot("C", (2.0, 1.0), (7.0, 4.1))]
    curve = path_of([a_robot("A", (1.0, 4.0), (9.0, 4.0)), *others])
    for x, y in ((5.0, 4.0), (7.0, 4.1)):
        assert np.hypot(*(sampled(curve) - (x, y)).T).min() > 0.2 + 0.2 + MARGIN


def test_a_place_in_a_corridor_is_crossed_rather_than_no_path_given():
    walls = [box(2, 0, 8, 3.5), box(2, 4.5, 8, 8)]
    others = [a_robot("B", (5.0, 4.0), (9.0, 7.0))]
    curve = path_of([a_robot("A", (1.0, 4.0), (9.0, 4.0)), *others], walls)
    assert np.hypot(*(sampled(curve) - (5.0, 4.0)).T).min() < 0.4
    assert least_gap(curve, shapely.union_all([shapely.box(*w[0], *w[2]) for w in walls])) > 0.2


def test_detours_are_kept_off_and_refuges_are_passed():
    scenario = a_scenario([a_robot("A", (1.0, 4.0), (9.0, 4.0), via=((7.0, 4.0),))])
    finder = Pathfinder(scenario)
    curve = finder.path(0, detours=np.array([[4.0, 4.0, 1.0]]))
    assert np.hypot(*(sampled(curve) - (4.0, 4.0)).T).min() > 1.0 - 2e-3
    curve = finder.path(0, refuge=(3.0, 6.0))
    gaps = [np.hypot(*(sampled(curve, 20_001) - place).T) for place in ((3.0, 6.0), (7.0, 4.0))]
    assert max(gap.min() for gap in gaps) < 1e-3
    assert gaps[0].argmin() < gaps[1].argmin()


def test_the_same_question_gets_the_same_bytes():
    floor, robots = asked_at_random(1)
    scenario = a_scenario(robots, floor.obstacles, floor.boundary, check=False)
    used = Pathfinder(scenario)
    for index in (*range(len(robots)), 0):
        again = path_or_sentence(used, index)
        fresh = path_or_sentence(Pathfinder(scenario), index)
        if isinstance(again, str):
            assert fresh == again
        else:
            assert fresh.points.tobytes() == again.points.tobytes()
            assert fresh.knots.tobytes() == again.knots.tobytes()


def test_paths_found_in_parts_by_threads_are_those_found_one_by_one():
    scenario = generate("warehouse", 120, 3)
    alone = find_paths(Pathfinder(scenario))
    with ThreadPoolExecutor(2) as executor:
        parts = find_paths(Pathfinder(scenario), executor)
    for one, other in zip(alone, parts, strict=True):
        assert one.points.tobytes() == other.points.tobytes()
        assert one.knots.tobytes() == other.knots.tobytes()


def test_a_robot_with_no_room_for_its_heading_is_told_so():
    facing_a_wall = a_robot("A", (1.0, 4.0, math.pi), (9.0, 4.0))
    with pytest.raises(PlanError, match=r"^A: no room to move along heading 3\.14 rad at its st"):
        path_of([facing_a_wall], [box(0, 3, 0.775, 5)])


@pytest.mark.parametrize("room", [0.07, 0.03, 0.015])
def test_a_robot_that_faces_a_wall_all_but_turns_where_it_stands(room):
    facing_a_wall = a_robot("A", (1.0, 4.0, math.pi), (9.0, 4.0))
    path = path_of([facing_a_wall], [box(0, 3, 0.78 - room, 5)])
    assert path.points[:, 0].min() >= 1.0 - room
    assert path.length < 8.25
    along = path.points[1] - path.points[0]
    assert math.atan2(*along[::-1]) == pytest.approx(math.pi, abs=8e-3)


def test_a_robot_with_no_room_for_its_heading_at_the_goal_is_told_the_one_that_was_asked_for():
    from_a_wall = a_robot("A", (9.0, 4.0), (1.0, 4.0, 0.25))
    said = r"^A: no room to move along heading 0\.25 rad at its goal \(1\.00, 4\.00\); more room"
    with pytest.raises(PlanError, match=said):
        path_of([from_a_wall], [box(0, 3, 0.775, 5)])


def test_paths_of_small_robots_far_from_the_origin_have_sharp_chords():
    workspace = Workspace(boundary=tuple(box(7000, -7000, 7001.2, -6999.84)), obstacles=())
    robots = (
        a_robot("A", (7000.13617, -6999.87305), (7000.07861, -6999.8464), radius=0.0044),
        a_robot("B", (7000.12338, -6999.88515), (7000.13617, -6999.87305, 2.956), radius=0.0053),
    )
    finder = Pathfinder(Scenario(name="t", workspace=workspace, robots=robots, margin=1e-5))
    for path in find_paths(finder):
        assert chords_of(path, 5e-4).error <= 5e-4
