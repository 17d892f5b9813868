"""Paths that a scenario gives: kept as they are, or told to be impossible in a line each."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
import shapely

from coordinator.base.errors import InputError, PlanError
from coordinator.fleet.rest_places import Standing
from coordinator.mission.recovery import recover
from coordinator.mission.replanning_input import Site
from coordinator.paths.given_path import curve_of, path_of
from coordinator.plan.plan_file import to_json
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_fleet, plan_scenario
from coordinator.scenario.floor import Floor
from coordinator.scenario.model import GivenPath
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.scenario_files.toml_writer import scenario_to_toml
from tests.coordinator.curves.random_curves import full_circle
from tests.oracles import complaints, naive_points
from tests.scenarios import a_robot, a_scenario, box

BEND = ((1.0, 1.0), (3.0, 1.2), (5.0, 1.0), (7.0, 1.5), (8.0, 3.0), (8.5, 5.0), (9.0, 7.0))
WEIGHTS = (1.0, 2.0, 1.0, 0.5, 1.0, 3.0, 1.0)
ELBOW = ((1.0, 1.0), (9.0, 1.0), (9.0, 7.0))


def given(name, points, degree=3, knots=(), weights=(), rounding=0.0, **fields):
    path = GivenPath(
        degree=degree, control_points=points, knots=knots, weights=weights, rounding=rounding
    )
    return a_robot(name, points[0], points[-1], path=path, **fields)


def own_knots(degree):
    inner = np.sort(np.random.default_rng(degree).uniform(0.2, 0.8, len(BEND) - degree - 1))
    return (0.0,) * (degree + 1) + tuple(inner.tolist()) + (1.0,) * (degree + 1)


def uniform(degree, count):
    return [0.0] * degree + np.linspace(0.0, 1.0, count - degree + 1).tolist() + [1.0] * degree


def points_on(degree, knots, points, weights, count=301):
    return naive_points(degree, knots, points, weights, np.linspace(knots[0], knots[-1], count))


def farthest(places, planned):
    """How far places are from a planned path, by its own naive evaluation."""
    line = points_on(
        planned.degree, planned.knots, planned.control_points, planned.weights, count=20_001
    )
    return shapely.distance(shapely.points(places), shapely.linestrings(line)).max()


@pytest.mark.parametrize("weights", [(), WEIGHTS], ids=["plain", "weighted"])
@pytest.mark.parametrize("own", [False, True], ids=["uniform", "knots"])
@pytest.mark.parametrize("degree", [2, 3, 5])
def test_a_given_path_is_the_one_that_is_planned_proven_and_sent(degree, own, weights):
    knots = own_knots(degree) if own else ()
    scenario = a_scenario(
        [given("R1", BEND, degree, knots, weights), a_robot("R2", (2.0, 6.0), (6.0, 0.6))]
    )
    document = plan_scenario(scenario, effort=0)
    assert document.proof.holds
    assert complaints(to_json(document), scenario) == []
    all_knots = knots or uniform(degree, len(BEND))
    expected = points_on(degree, all_knots, BEND, weights or (1.0,) * len(BEND))
    assert farthest(expected, document.robots[0].path) < 1e-6


def test_a_path_from_a_plan_is_planned_again_to_the_last_bit():
    free = a_scenario([a_robot("R1", (1.0, 1.0), (9.0, 7.0))], obstacles=[box(4, 2, 6, 6)])
    path = plan_scenario(free, effort=0).robots[0].path
    assert len(path.control_points) > 4
    points = tuple(path.control_points)
    again = given("R1", points, path.degree, tuple(path.knots), tuple(path.weights))
    kept = plan_scenario(msgspec.structs.replace(free, robots=(again,)), effort=0).robots[0]
    assert kept.path == path


def test_a_given_polyline_with_rounded_corners_is_cut_by_no_more_than_asked():
    scenario = a_scenario([given("R1", ELBOW, 1, rounding=0.03)])
    document = plan_scenario(scenario, effort=0)
    planned, (one,) = document.robots[0], drive(document)
    line = shapely.LineString(one.chain.points)
    assert line.distance(shapely.Point(ELBOW[1])) == pytest.approx(0.03, abs=3e-4)
    assert line.hausdorff_distance(shapely.LineString(ELBOW)) < 0.0303
    assert max(v for _, v in planned.profile) == pytest.approx(0.76, abs=1e-3)
    assert farthest(np.array(ELBOW[::2]), planned.path) < 1e-6


def test_robots_that_need_no_time_to_turn_take_the_corners_of_a_polyline():
    robot = given("R1", ELBOW, 1, weights=(1.0, 4.0, 2.0), max_accel=math.inf)
    planned = plan_scenario(a_scenario([robot]), effort=0).robots[0]
    assert planned.length == pytest.approx(14.0, abs=1e-5)
    assert farthest(np.array(ELBOW), planned.path) < 1e-6


def test_a_straight_polyline_needs_no_rounding():
    points = ((1.0, 1.0), (2.0, 1.0), (9.0, 1.0))
    planned = plan_scenario(a_scenario([given("R1", points, 1)]), effort=0).robots[0]
    assert planned.length == pytest.approx(8.0)


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        (given("R1", ((1.0, 1.0), (5.0, 17.0), (9.0, 1.0)), 2), "leaves the floor near (5.00, 9.0"),
        (given("R1", ((1.0, 4.0), (9.0, 4.0)), 1), "leads through an obstacle near"),
        (given("R1", ((1.0, 2.9), (9.0, 2.9)), 1), "comes within 0.100 m of an obstacle near"),
        (given("R1", ((1.0, 1.0), (5.0, 0.0), (9.0, 1.0)), 2, min_turn_radius=30.0), "bends with"),
        (given("R1", ELBOW, 1), "turns on the spot by 90 degrees at (9.00, 1.00)"),
        (
            given("R1", ((1.0, 1.0), (9.0, 1.0), (1.0, 1.0)), 2),
            "turns on the spot by 180 degrees at (5.00",
        ),
        (
            given("R1", ((1.0, 1.0), (9.0, 1.0), (2.0, 1.0)), 1, rounding=0.1),
            "turns on the spot by 180 degrees at (9.00, 1.00)",
        ),
        (given("R1", ((1.0, 1.0), (1.0, 1.0)), 1), "has no length"),
        (
            given("R1", ((1.0, 1.0), (1.0, 1.0), (5.0, 1.5), (9.0, 2.0)), 3),
            "has no direction at (1.00, 1.00), where control points are repeated",
        ),
    ],
)
def test_a_path_that_cannot_be_driven_is_told_with_the_robot_and_where(robot, words):
    other = given("R2", ((1.0, 6.0), (8.0, 6.0)), 1)
    scenario = a_scenario([robot, other], obstacles=[box(4, 3, 6, 5)])
    with pytest.raises(PlanError) as told:
        plan_scenario(scenario, effort=0)
    assert str(told.value).startswith("R1: its path ")
    assert words in str(told.value)
    assert "\n" not in str(told.value)
    with pytest.raises(InputError) as refused:
        parse_scenario(scenario_to_toml(scenario), "given.toml")
    (line,) = refused.value.problems
    assert line.startswith("given.toml: robots[0].path: R1: its path ")
    assert words in line


def test_all_given_paths_that_cannot_be_driven_are_told_at_once():
    robots = [given(f"R{i}", ((1.0, y), (9.0, y)), 1) for i, y in enumerate((2.9, 4.0, 5.1))]
    scenario = a_scenario(robots, obstacles=[box(4, 3, 6, 5)])
    with pytest.raises(InputError) as refused:
        parse_scenario(scenario_to_toml(scenario), "given.toml")
    assert [line.split(": ")[2] for line in refused.value.problems] == ["R0", "R1", "R2"]


HEAD = '[workspace]\nbounds = [0.0, 0.0, 10.0, 8.0]\n[[robots]]\nid = "R1"\nradius = 0.2\n'


@pytest.mark.parametrize(
    ("path", "problem"),
    [
        ("{degree = 3, control_points = [[1, 1], [2, 2]]}", "control_points: has 2, degree 3"),
        ("{degree = 1, control_points = [[1, 1]]}", "control_points: has 1, degree 1"),
        ("{degree = 1, control_points = []}", "control_points: has 0, degree 1"),
        ("{degree = 8, control_points = [[1, 1], [2, 2]]}", "degree: is 8, must be 1 to 7"),
        ("{degree = 1.5, control_points = [[1, 1], [2, 2]]}", "degree: 1.5 is not a whole number"),
        ("{control_points = [[1, 1], [2, 2]]}", "degree: is missing"),
        ("{degree = 1, control_points = [[1, 1], [2]]}", "control_points[1]: a list of 1 is not"),
        (
            "{degree = 1, control_points = [[1, 1], [2, 2]], knots = [0, 1]}",
            "knots: has 2, must have control points + degree + 1 = 4",
        ),
        (
            "{degree = 1, control_points = [[1, 1], [2, 2]], knots = [0, 1, 0, 1]}",
            "knots[2]: is 0 after 1, must not decrease",
        ),
        (
            "{degree = 1, control_points = [[1, 1], [2, 2]], knots = [3, 3, 3, 3]}",
            "knots: are all the same, must end above where they begin",
        ),
        (
            "{degree = 1, control_points = [[1, 1], [2, 2]], weights = [1, -2]}",
            "weights[1]: is -2, must be above 0 to 1e+30",
        ),
        (
            "{degree = 1, control_points = [[1, 1], [2, 2]], weights = [1]}",
            "weights: has 1, must have one for each of 2 control points",
        ),
        (
            "{degree = 1, control_points = [[1, 1], [2, 2]], knots = [0, 'a']}",
            "knots[1]: 'a' is not a number",
        ),
        (
            "{degree = 1, control_points = [[1, 1], [2, 2]], weights = [1e-300, 1]}",
            "weights: differ by over a million times, must be at most 100",
        ),
        ("{degree = 1, control_points = [[1, 1], [2, 2]], knot = []}", "knot: unknown key"),
        ("3", "path: 3 is not a table"),
    ],
)
def test_a_path_with_wrong_parts_is_told_by_its_field(path, problem):
    with pytest.raises(InputError) as refused:
        parse_scenario(f"{HEAD}max_speed = 0.5\npath = {path}\n".encode(), "given.toml")
    (line,) = refused.value.problems
    assert line.startswith("given.toml: robots[0].path")
    assert problem in line


def test_a_path_stands_in_place_of_start_and_goal():
    path = "path = {degree = 1, control_points = [[1, 1], [2, 2]]}\nstart = [1.0, 1.0]\n"
    with pytest.raises(InputError) as refused:
        parse_scenario(f"{HEAD}max_speed = 0.5\n{path}".encode(), "given.toml")
    (line,) = refused.value.problems
    assert line.startswith("given.toml: robots[0].start: is given as well as path")


def test_ends_of_paths_are_told_by_their_control_points():
    near = [given(f"R{i}", ((1.0, 1.0 + i), (9.0, 3.1 + 0.1 * i)), 1) for i in range(2)]
    scenario = a_scenario([near[0]])
    scenario = msgspec.structs.replace(scenario, robots=tuple(near))
    with pytest.raises(InputError) as refused:
        parse_scenario(scenario_to_toml(scenario), "given.toml")
    (line,) = refused.value.problems
    assert line.startswith(
        "given.toml: robots[1].path.control_points[1]: R1 is 0.1 m from the goal"
    )


@pytest.mark.parametrize("write", [scenario_to_toml, scenario_to_json])
def test_given_paths_are_written_and_read_back_the_same(write):
    robots = [
        given("R1", BEND, 3, own_knots(3), WEIGHTS, 0.01, priority=2),
        given("R2", ((1.0, 7.0), (9.0, 7.5)), 1),
    ]
    scenario = a_scenario(robots)
    name = "again.json" if write is scenario_to_json else "again.toml"
    assert parse_scenario(write(scenario), name) == scenario


def test_others_go_around_where_a_given_path_blocks_them_but_it_stays():
    line = ((1.0, 4.0), (9.0, 4.0))
    scenario = a_scenario([given("R1", line, 1), a_robot("R2", (9.0, 4.6), (1.0, 4.0 - 0.6))])
    document = plan_scenario(scenario)
    assert document.proof.holds
    assert farthest(np.array(line), document.robots[0].path) < 1e-6
    assert document.robots[0].length == pytest.approx(8.0)


def test_a_path_that_goes_round_to_its_start_is_driven():
    path = path_of(full_circle())
    points = tuple((x + 5.0, y + 4.0) for x, y in path.control_points)
    planned = plan_scenario(
        a_scenario([given("R1", points, 2, path.knots, path.weights)]), effort=0
    ).robots[0]
    assert planned.length == pytest.approx(math.tau, abs=1e-5)
    angles = np.linspace(0.0, math.tau, 100)
    circle = np.column_stack((5.0 + np.cos(angles), 4.0 + np.sin(angles)))
    assert farthest(circle, planned.path) < 2e-6


@pytest.fixture(scope="module")
def frozen():
    robots = [given("R1", BEND, 3), a_robot("R2", (2.0, 6.0), (6.0, 0.6))]
    scenario = a_scenario(robots)
    return Site(scenario), {1: plan_scenario(scenario, effort=0)}


def rides(documents):
    return {(one.id, 1, 0): one for one in drive(documents[1])}


def go_on(frozen, **fields):
    site, documents = frozen
    told = (
        Standing(robot="R1", state="rests", epoch=1, s=2.0, **fields),
        Standing(robot="R2", state="rests", epoch=1, s=0.5),
    )
    return recover(site, rides(documents), told, 2, lambda scenario, epoch: plan(scenario, epoch))


def plan(scenario, epoch):
    return plan_fleet(scenario, effort=0, epoch=epoch)


def test_after_a_freeze_a_robot_drives_the_rest_of_its_given_path(frozen):
    before = frozen[1][1].robots[0]
    rest = go_on(frozen, off=0.002).document.robots[0]
    assert rest.length == pytest.approx(before.length - 2.0, abs=1e-3)
    whole = points_on(before.path.degree, before.path.knots, before.path.control_points, (1.0,) * 7)
    (one,) = [d for d in drive(frozen[1][1]) if d.id == "R1"]
    later = whole[one.curve.arc_at(np.linspace(0, before.path.knots[-1], 301)) > 2.0]
    assert farthest(later, rest.path) < 2e-6


def test_a_robot_pushed_off_its_given_path_finds_its_own_way_to_the_goal(frozen):
    found = go_on(frozen, off=0.3)
    (robot,) = [r for r in found.site.scenario.robots if r.id == "R1"]
    assert robot.path is None
    assert robot.goal == BEND[-1]
    assert found.document.proof.holds


def test_a_robot_whose_given_path_is_blocked_by_a_lost_one_goes_around_it(frozen):
    site, documents = frozen
    (other,) = [d for d in drive(documents[1]) if d.id == "R2"]
    near = shapely.LineString(other.chain.points).project(shapely.Point(5.0, 1.15))
    told = (
        Standing(robot="R1", state="rests", epoch=1, s=0.5),
        Standing(robot="R2", state="lost", epoch=1, s=near),
    )
    found = recover(site, rides(documents), told, 2, plan)
    assert found.said[0].startswith("R1 leaves the path that it was given: R1: its path ")
    assert found.document.robot("R1").path.control_points[-1] == BEND[-1]
    assert found.document.proof.holds


def test_a_polyline_may_say_a_place_twice():
    points = ((1.0, 1.0), (1.0, 1.0), (5.0, 1.0), (5.0, 1.0), (9.0, 1.0))
    planned = plan_scenario(a_scenario([given("R1", points, 1)]), effort=0).robots[0]
    assert planned.length == pytest.approx(8.0)


def test_weights_of_any_scale_make_the_same_path():
    lengths = [
        plan_scenario(a_scenario([given("R1", BEND, weights=weights)]), effort=0).robots[0].length
        for weights in (
            WEIGHTS,
            tuple(1e-200 * w for w in WEIGHTS),
            tuple(1e200 * w for w in WEIGHTS),
        )
    ]
    assert lengths[1:] == pytest.approx([lengths[0]] * 2)


def test_knots_of_any_scale_make_the_same_curve():
    places = np.linspace(0.0, 1.0, 50)
    curves = []
    for scale in (1e-12, 1.0, 1e9):
        knots = tuple(scale * (5.0 + knot) for knot in own_knots(3))
        path = GivenPath(degree=3, control_points=BEND, knots=knots)
        curve = curve_of(path)
        curves.append(curve.at_arc(places * curve.length))
    np.testing.assert_allclose(curves[0], curves[1], atol=1e-3)
    np.testing.assert_allclose(curves[2], curves[1], atol=1e-5)


def test_where_a_path_of_kilometres_leaves_the_floor_is_looked_for_once(monkeypatch):
    looks = []
    distance = Floor.distance
    monkeypatch.setattr(
        Floor,
        "distance",
        lambda floor, places: looks.append(len(places)) or distance(floor, places),
    )
    path = given("R1", ((1.0, 1.0), (1.5, 4_000.0), (2.0, 1.0)), 2)
    with pytest.raises(InputError, match=r"leaves the floor near \(1\.50, 2000\.5"):
        parse_scenario(scenario_to_json(a_scenario([path])), "far.json")
    assert len(looks) < 10
    assert max(looks) < 100_000
