"""VDA 5050: orders written by the standard, anybody's read, and the same curve after both."""

from __future__ import annotations

import copy
import json
import math
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
import shapely
from msgspec.structs import replace
from typer.testing import CliRunner

from coordinator.base.errors import InputError, PlanError
from coordinator.cli.log_commands import commands as log_commands
from coordinator.cli.vda5050_commands import commands
from coordinator.curves.nurbs import nurbs
from coordinator.curves.splines import joined, joined_count
from coordinator.exchange.vda5050_orders import orders_of
from coordinator.exchange.vda5050_reading import Assumed, read_order, scenario_of
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import parse_scenario, read_scenario
from tests.json_schema import problems
from tests.oracle_vda5050 import complaints, curve
from tests.oracles import naive_points
from tests.scenarios import a_robot, a_scenario, box
from tests.test_readme import ROOT

NOW = "2026-11-21T12:00:00.000Z"
GOLDEN = Path(__file__).parents[2] / "golden" / "vda5050"
SCHEMAS = {path.name: json.loads(path.read_text()) for path in GOLDEN.glob("*.json")}
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))
DRIVEN = [
    path for path in EXAMPLES if not all(robot.is_idle for robot in read_scenario(path).robots)
]
"""Those in which somebody has a goal from the beginning."""
ASSUMED = Assumed(radius=0.2, max_speed=0.8, rounding=0.02)
WAITING = a_scenario(
    [
        a_robot("R1", (1.0, 4.0), (9.0, 4.0)),
        a_robot("R2", (5.0, 1.0), (5.0, 7.0)),
        a_robot("R3", (1.0, 1.0), (9.0, 7.0)),
        a_robot("R4", (1.0, 7.0), (9.0, 1.0), via=((3.0, 5.0),)),
    ]
)


@pytest.fixture(scope="module")
def document():
    return plan_scenario(WAITING, effort=0)


def as_json(order):
    return json.loads(msgspec.json.encode(order))


def read(order, file="R1.json"):
    noted = []
    found = read_order(json.dumps(order).encode(), file, noted)
    return found, noted


def check(order):
    assert len(SCHEMAS) == 2
    for name, schema in SCHEMAS.items():
        assert list(problems(schema, order)) == [], name
    assert complaints(order) == []


def points_on(path, per_span):
    spans = pairwise(np.unique(path.knots).tolist())
    u = np.concatenate([np.linspace(*span, per_span) for span in spans])
    return naive_points(path.degree, path.knots, path.control_points, path.weights, u)


def off(places, path):
    """How far places are from a path, by naive evaluation."""
    line = shapely.linestrings(points_on(path, 4_001))
    return shapely.distance(shapely.points(places), line).max()


def apart(one, other):
    return off(points_on(one, 50), other)


@pytest.mark.parametrize("path", DRIVEN, ids=lambda path: path.stem)
def test_orders_of_every_example_are_valid_and_come_back_as_the_same_curves(path):
    scenario = read_scenario(path)
    document = plan_scenario(scenario, effort=0)
    orders = orders_of(document, NOW)
    assert list(orders) == [robot.id for robot in document.robots]
    found = []
    for order in orders.values():
        check(as_json(order))
        found.append(read(as_json(order))[0])
    made = scenario_of(found, "again", ASSUMED, scenario)
    again = plan_scenario(made, effort=0)
    assert again.proof.holds
    for before, after in zip(document.robots, again.robots, strict=True):
        assert apart(before.path, after.path) < 1e-6
        assert len(after.path.control_points) <= len(before.path.control_points) + 1
        assert after.length == pytest.approx(before.length, abs=1e-5)


def test_a_path_across_a_large_floor_comes_back_as_the_same_curve():
    obstacles = [box(50, 20, 60, 190), box(150, 10, 170, 150), box(230, 60, 250, 190)]
    robots = [a_robot("A", (5.3, 100.2), (290.1, 101.7)), a_robot("B", (100.3, 180.2), (283, 21.7))]
    scenario = a_scenario(robots, (300.0, 200.0), obstacles)
    document = plan_scenario(scenario, effort=0)
    found = [read(as_json(order))[0] for order in orders_of(document, NOW).values()]
    again = plan_scenario(scenario_of(found, "again", ASSUMED, scenario), effort=0)
    for before, after in zip(document.robots, again.robots, strict=True):
        assert apart(before.path, after.path) < 1e-6
        assert before.path.control_points == after.path.control_points


def test_an_order_says_where_a_robot_waits_how_long_and_for_whom(document):
    waiting = [robot for robot in document.robots if robot.stops]
    assert waiting
    for robot in waiting:
        order = as_json(orders_of(document, NOW)[robot.id])
        stops = order["nodes"][1:-1]
        for node, stop in zip(stops, robot.stops, strict=True):
            (action,) = node["actions"]
            assert action["blockingType"] == "HARD"
            told = {one["key"]: one["value"] for one in action["actionParameters"]}
            assert told["duration"] == pytest.approx(stop.depart - stop.arrive)
            assert told["until"] == stop.depart
            assert told.get("yieldsTo", "") == stop.yields_to


def test_the_base_ends_where_a_robot_first_waits(document):
    for robot in document.robots:
        order = as_json(orders_of(document, NOW)[robot.id])
        released = [node["released"] for node in order["nodes"]]
        first = [i for i, node in enumerate(order["nodes"]) if node["actions"]]
        base = first[0] + 1 if first else len(released)
        assert released == [True] * base + [False] * (len(released) - base)


def test_pieces_of_an_order_put_together_are_the_path_of_the_plan(document):
    for robot in document.robots:
        edges = as_json(orders_of(document, NOW)[robot.id])["edges"]
        for edge in edges:
            places = naive_points(*curve(edge["trajectory"]), np.linspace(0.0, 1.0, 60))
            assert off(places, robot.path) < 1e-7


def test_an_order_says_the_version_that_is_asked_for(document):
    assert orders_of(document, NOW, "3.0.0")["R1"].version == "3.0.0"


def test_the_check_of_orders_finds_what_is_wrong_with_one(document):
    whole = as_json(orders_of(document, NOW)["R1"])

    def broken(change):
        order = copy.deepcopy(whole)
        change(order["edges"][0]["trajectory"])
        return complaints(order)

    assert broken(lambda t: t["knotVector"].pop())
    assert broken(lambda t: t["knotVector"].__setitem__(1, 0.1))
    assert broken(lambda t: t["controlPoints"][1].__setitem__("weight", 0.0))
    assert broken(lambda t: t["controlPoints"][0].__setitem__("x", 0.0))
    assert broken(lambda t: t["controlPoints"][-1].__setitem__("x", 0.0))


PLACES = [(1.0, 1.0), (3.0, 1.2), (5.0, 1.0), (7.0, 1.5), (8.0, 3.0), (8.5, 5.0), (9.0, 7.0)]
WEIGHTS = [1.0, 2.0, 1.0, 0.5, 1.0, 3.0, 1.0]


def uniform(degree, count):
    return [0.0] * degree + np.linspace(0.0, 1.0, count - degree + 1).tolist() + [1.0] * degree


def somebodys(degree=3, places=PLACES, weights=None, knots=None, robot="AGV 7", speed=0.6):
    """An order of one edge, as another master control may write it."""
    control = [{"x": x, "y": y} for x, y in places]
    for point, weight in zip(control, weights or [], strict=False):
        point["weight"] = weight
    trajectory = {"degree": degree, "controlPoints": control}
    if knots is not None:
        trajectory["knotVector"] = knots
    edge = {"edgeId": "e", "sequenceId": 1, "released": True, "actions": []}
    edge |= {"maximumSpeed": speed, "trajectory": trajectory}
    nodes = [
        {"nodeId": name, "sequenceId": i, "released": True, "actions": []}
        for name, i in (("a", 0), ("b", 2))
    ]
    order = {"headerId": 1, "timestamp": NOW, "version": "3.0.0", "manufacturer": "other"}
    order |= {"serialNumber": robot, "orderId": "1", "orderUpdateId": 0}
    return order | {"nodes": nodes, "edges": [edge]}


@pytest.mark.parametrize("knotted", [False, True], ids=["uniform", "knots"])
@pytest.mark.parametrize("weights", [None, WEIGHTS], ids=["plain", "weighted"])
@pytest.mark.parametrize("degree", [1, 2, 3, 5])
def test_orders_of_any_degree_are_scheduled_on_their_curves(degree, weights, knotted):
    knots = sorted(uniform(degree, 7)) if knotted else None
    if knotted and degree < 6:
        knots[degree + 1] = 0.5 * (knots[degree] + knots[degree + 1])
    order = somebodys(degree, weights=weights, knots=knots)
    assert list(problems(SCHEMAS["order-main.schema.json"], order)) == []
    found, noted = read(order)
    assert noted == []
    other = somebodys(robot="other", places=[(1.0, 7.0), (4.0, 6.0), (8.0, 1.0), (9.0, 1.0)])
    made = scenario_of([found, read(other)[0]], "theirs", ASSUMED, None)
    assert parse_scenario(msgspec.json.encode(to_builtins(made)), "x.json")
    document = plan_scenario(made, effort=0)
    assert document.proof.holds
    assert document.robots[0].id == "AGV-7"
    all_knots, all_weights = knots or uniform(degree, 7), weights or [1.0] * 7
    theirs = naive_points(degree, all_knots, PLACES, all_weights, np.linspace(0.0, 1.0, 200))
    assert off(theirs, document.robots[0].path) < (0.0202 if degree == 1 else 1e-6)


def to_builtins(scenario):
    robots = []
    for robot in scenario.robots:
        path = msgspec.to_builtins(robot.path)
        robots.append(
            {"id": robot.id, "radius": robot.radius, "max_speed": robot.max_speed, "path": path}
        )
    floor = {"boundary": scenario.workspace.boundary}
    return {"workspace": floor, "robots": robots}


def broken(**trajectory):
    order = somebodys(knots=uniform(3, 7))
    kept = order["edges"][0]["trajectory"] | trajectory
    order["edges"][0]["trajectory"] = {k: v for k, v in kept.items() if v != "absent"}
    return order


def points(weight=None, count=7):
    made = [{"x": x, "y": y} for x, y in PLACES[:count]]
    if weight is not None:
        made[2]["weight"] = weight
    return made


def without(key):
    order = somebodys()
    del order[key]
    return order


def edge_with(**fields):
    order = somebodys()
    order["edges"][0] |= fields
    return order


DEVIATION = "nodes[0].nodePosition.allowedDeviationXY"


def noded(**position):
    return somebodys() | {"nodes": [{"nodePosition": position}]}


@pytest.mark.parametrize(
    ("order", "line"),
    [
        (
            broken(knotVector=[0, 0, 0, 0, 1, 1, 1, 1]),
            "edges[0].trajectory.knotVector: has 8, must have control points + degree + 1 = 11",
        ),
        (
            broken(controlPoints=points(0)),
            "edges[0].trajectory.controlPoints[2].weight: 0 is not positive",
        ),
        (
            broken(controlPoints=points(-1.5)),
            "edges[0].trajectory.controlPoints[2].weight: -1.5 is not positive",
        ),
        (
            broken(controlPoints=points(count=1), knotVector="absent"),
            "edges[0].trajectory.controlPoints: has 1, degree 3 needs 4 or more",
        ),
        (
            broken(controlPoints=points(count=1), knotVector="absent", degree="absent"),
            "edges[0].trajectory.controlPoints: has 1, degree 1 needs 2 or more",
        ),
        (edge_with(trajectory=None), "edges[0].trajectory: is missing"),
        (edge_with(trajectory=[]), "edges[0].trajectory: a list of 0 is not an object"),
        (
            broken(controlPoints="absent"),
            "edges[0].trajectory.controlPoints: is missing",
        ),
        (broken(degree=9), "edges[0].trajectory.degree: is 9, must be 1 to 7"),
        (broken(degree="3"), "edges[0].trajectory.degree: '3' is not a whole number"),
        (
            broken(knotVector=[0.1, *uniform(3, 7)[1:]]),
            "edges[0].trajectory.knotVector[1]: is -0.1 after 0, must not decrease",
        ),
        (
            broken(knotVector=[0, 0.1, 0.1, *uniform(3, 7)[3:4], *uniform(3, 7)[4:]]),
            "edges[0].trajectory.knotVector[3]: is 0 after 0.1, must not decrease",
        ),
        (
            broken(knotVector=[0, 0, 0, 0.1, 0.25, 0.5, 0.75, 1, 1, 1, 1]),
            "edges[0].trajectory.knotVector: the first 4 are 0 to 0.1, must all be 0",
        ),
        (broken(knotVector=[1] * 11), "edges[0].trajectory.knotVector: are all the same, must end"),
        (broken(knotVector=[]), "edges[0].trajectory.knotVector: is empty"),
        (
            broken(controlPoints=[{"x": 1.0, "y": 1.0}] * 7),
            "edges[0].trajectory.controlPoints: are all in one place",
        ),
        (
            broken(controlPoints=[{"x": 1.0}, *points()[1:]]),
            "edges[0].trajectory.controlPoints[0].y: null is not a number",
        ),
        (edge_with(maximumSpeed=-1.0), "edges[0].maximumSpeed: -1.0 m/s is below 0.001 m/s"),
        (without("edges"), "edges: is missing"),
        (somebodys() | {"edges": []}, "edges: is empty, so there is nothing to drive"),
        (without("serialNumber"), "serialNumber: is missing"),
        ([1], "order: a list of 1 is not an object"),
        (edge_with(sequenceId="1"), "edges[0].sequenceId: '1' is not a whole number"),
        (edge_with(sequenceId=1.5), "edges[0].sequenceId: 1.5 is not a whole number"),
        (edge_with(sequenceId=-1), "edges[0].sequenceId: -1 is not a whole number"),
        (noded(allowedDeviationXY="a"), f"{DEVIATION}: 'a' is not a number"),
        (noded(allowedDeviationXY=math.nan), f"{DEVIATION}: nan is not a finite number"),
        (noded(allowedDeviationXY={"a": -5}), f"{DEVIATION}.a: -5 m is below 0 m"),
        (noded(x=math.nan), "nodes[0].nodePosition.x: nan is not a finite number"),
        (somebodys() | {"nodes": [{"sequenceId": "x"}]}, "nodes[0].sequenceId: 'x' is not a whole"),
        (
            somebodys() | {"nodes": [{"sequenceId": 4}] * 2},
            "nodes[1].sequenceId: 4 is also that of nodes[0]",
        ),
        (
            edge_with(startNodeId="nowhere") | {"nodes": [{"nodeId": "n0"}]},
            "edges[0].startNodeId: 'nowhere' is not a node of this order",
        ),
        (
            edge_with(startNodeId="n0", endNodeId="None") | {"nodes": [{"nodeId": "n0"}, {}]},
            "edges[0].endNodeId: 'None' is not a node of this order",
        ),
        (somebodys() | {"nodes": 1}, "nodes: 1 is not a list"),
        (somebodys() | {"nodes": [1]}, "nodes[0]: 1 is not an object"),
        (somebodys() | {"nodes": [{"nodePosition": 1}]}, "nodes[0].nodePosition: 1 is not an"),
        (
            broken(controlPoints=[{"x": float(x), "y": 1.0} for x in range(5_001)]),
            "edges[0].trajectory.controlPoints: are 5,001, must be at most 5,000",
        ),
    ],
)
def test_a_malformed_order_is_told_in_one_line(order, line):
    found, noted = read(order, "bad.json")
    assert found is None
    (told,) = noted
    assert told.startswith(f"bad.json: {line}")


def test_everything_that_is_wrong_with_one_order_is_told():
    order = broken(controlPoints=points(-1.0), degree="3") | {"serialNumber": 7}
    order["edges"].append({"sequenceId": 3, "maxSpeed": 0})
    found, noted = read(order, "bad.json")
    assert found is None
    assert [line.split(": ")[1] for line in noted] == [
        "serialNumber",
        "edges[1].maxSpeed",
        "edges[0].trajectory.degree",
        "edges[0].trajectory.controlPoints[2].weight",
        "edges[1].trajectory",
    ]


def test_what_is_no_json_is_told_in_one_line():
    noted = []
    assert read_order(b"\xff{", "bad.json", noted) is None
    assert len(noted) == 1
    assert "\n" not in noted[0]


def test_a_number_of_thousands_of_digits_is_told_in_our_words():
    noted = []
    assert read_order(b'{"version": ' + b"7" * 5_000 + b"}", "bad.json", noted) is None
    assert noted == ["bad.json: order: is not JSON: a number has too many digits"]


def two_edges(gap=0.0):
    order = somebodys(1, [(1.0, 1.0), (5.0, 1.0)])
    second = copy.deepcopy(order["edges"][0])
    places = [(5.0 + gap, 1.0), (8.0, 1.0), (9.0, 1.0)]
    second["trajectory"] = {"degree": 2, "controlPoints": [{"x": x, "y": y} for x, y in places]}
    second |= {"sequenceId": 3, "maximumSpeed": 0.4, "released": False}
    order["edges"].insert(0, second)
    return order


def test_edges_are_put_together_in_their_sequence_and_the_least_speed_counts():
    found, noted = read(two_edges())
    assert noted == []
    assert found.speed == 0.4
    assert found.curve.degree == 2
    np.testing.assert_allclose(found.curve.points[[0, -1]], [(1.0, 1.0), (9.0, 1.0)])
    assert found.curve.length == pytest.approx(8.0)


def test_edges_out_of_sequence_are_told():
    order = somebodys()
    (edge,) = order["edges"]
    order["edges"] = [edge | {"sequenceId": number} for number in (1, 1, None)]
    assert read(order)[1] == [
        "R1.json: edges[1].sequenceId: 1 is also that of edges[0]",
        "R1.json: edges[2].sequenceId: is missing",
    ]


def test_control_points_are_counted_as_the_robot_gets_them():
    line = [{"x": float(x), "y": 1.0} for x in range(1_002)]
    edges = [
        {"sequenceId": 2 * i + 1, "trajectory": {"controlPoints": [a, b]}}
        for i, (a, b) in enumerate(pairwise(line))
    ]
    bend = [{"x": 1_001.0 + k, "y": 1.0 + 0.1 * k * k} for k in range(8)]
    edges.append({"sequenceId": 9_999, "trajectory": {"degree": 7, "controlPoints": bend}})
    noted = read(somebodys() | {"edges": edges})[1]
    assert noted == ["R1.json: edges: their control points are 7,015, must be at most 5,000"]
    parts = [nurbs(1, [0, 0, 1, 1], [[x, x % 2], [x + 1, (x + 1) % 2]]) for x in range(9)]
    parts.append(nurbs(3, [0, 0, 0, 0, 1, 1, 1, 1], [[9 + x, 1 - x * x] for x in range(4)]))
    assert joined_count(parts) == len(joined(parts).points)


def test_a_name_of_dots_becomes_one_that_names_no_folder():
    assert read(somebodys(robot=".."))[0].robot == "--"


def test_a_gap_between_edges_is_told_with_its_place():
    found, noted = read(two_edges(0.1))
    assert found is None
    (line,) = noted
    assert line.startswith("R1.json: edges[0].trajectory: begins at (5.1, 1) m, 0.1 m from")


def test_corners_are_cut_by_no_more_than_nodes_allow():
    elbow = somebodys(1, [(1.0, 1.0), (9.0, 1.0), (9.0, 7.0)])
    for deviation, cut in ((None, 0.02), (0.0, 0.02), (0.005, 0.005), (0.3, 0.02)):
        elbow["nodes"][1]["nodePosition"] = {"x": 9, "y": 7, "mapId": "m"}
        if deviation is not None:
            elbow["nodes"][1]["nodePosition"]["allowedDeviationXY"] = deviation
        (robot,) = scenario_of([read(elbow)[0]], "x", ASSUMED, None).robots
        assert robot.path.rounding == cut
    elbow["nodes"][1]["nodePosition"]["allowedDeviationXY"] = {"a": 0.1, "b": 0.01, "theta": 0}
    (robot,) = scenario_of([read(elbow)[0]], "x", ASSUMED, None).robots
    assert robot.path.rounding == 0.01


def test_corners_that_may_not_be_cut_are_refused():
    elbow = somebodys(1, [(1.0, 1.0), (9.0, 1.0), (9.0, 7.0)])
    made = scenario_of([read(elbow)[0]], "x", ASSUMED._replace(rounding=0.0), None)
    with pytest.raises(PlanError, match=r"AGV-7: its path turns on the spot by 90 degrees at \(9"):
        plan_scenario(made, effort=0)


def test_robots_of_a_known_scenario_keep_its_limits_but_are_never_faster_than_permitted():
    like = a_scenario([a_robot("AGV-7", (1, 1), (2, 2), radius=0.33, max_accel=0.2, max_speed=2.0)])
    made = scenario_of([read(somebodys())[0]], "x", ASSUMED, replace(like, margin=0.07))
    (robot,) = made.robots
    assert (robot.radius, robot.max_accel, robot.max_speed) == (0.33, 0.2, 0.6)
    assert made.margin == 0.07
    assert made.workspace == like.workspace


def test_the_commands_write_orders_and_read_them_back(tmp_path, document):
    runner = CliRunner()
    plan = tmp_path / "plan.json"
    plan.write_bytes(to_json(document))
    folder = tmp_path / "orders"
    told = runner.invoke(log_commands, ["export", str(plan), "--to", "vda5050", "-o", str(folder)])
    assert told.exit_code == 0, told.output
    files = sorted(folder.iterdir())
    assert [file.name for file in files] == ["R1.json", "R2.json", "R3.json", "R4.json"]
    for file in files:
        check(json.loads(file.read_text()))
    for name in ("again.toml", "again.json"):
        made = tmp_path / name
        told = runner.invoke(commands, ["import", "vda5050", *map(str, files), "-o", str(made)])
        assert told.exit_code == 0, told.output
        again = plan_scenario(read_scenario(made), effort=0)
        for before, after in zip(document.robots, again.robots, strict=True):
            assert apart(before.path, after.path) < 1e-6


def test_all_that_is_wrong_with_all_orders_is_told_at_once(tmp_path):
    orders = {
        "good.json": somebodys(robot="twin"),
        "twin.json": somebodys(robot="twin"),
        "knots.json": broken(knotVector=[0, 1]),
        "weight.json": broken(controlPoints=points(0.0)),
    }
    for name, order in orders.items():
        (tmp_path / name).write_text(json.dumps(order))
    files = [str(tmp_path / name) for name in (*orders, "gone.json", "twin.json")]
    output = tmp_path / "x.toml"
    told = CliRunner().invoke(commands, ["import", "vda5050", *files, "-o", str(output)])
    assert isinstance(told.exception, InputError)
    names = [Path(line.split(": ")[0]).name for line in told.exception.problems]
    assert sorted(names) == sorted([*orders, "gone.json"])
    assert not output.exists()


def test_lengths_and_headings_of_nodes_are_those_of_the_path(document):
    for robot in document.robots:
        order = as_json(orders_of(document, NOW)[robot.id])
        assert sum(edge["length"] for edge in order["edges"]) == pytest.approx(robot.length)
        first, second = robot.path.control_points[:2]
        heading = math.atan2(second[1] - first[1], second[0] - first[0])
        assert order["nodes"][0]["nodePosition"]["theta"] == pytest.approx(heading)
