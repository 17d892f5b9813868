"""Robots that make room for each other, in plans judged by the proof and a dense sampler."""

import math

import numpy as np
import pytest
from msgspec.structs import replace

from benchmarks.movingai_maps import drawn
from coordinator.exchange.movingai import Bodies, scenario_of
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.plan_file import to_json
from coordinator.planning import planner, several_legs
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import GivenPath, Robot, Scenario, Workspace
from coordinator.schedule.refusals import BlockedError
from sim.floors.generator import RADIUS, generate
from tests.crowds import crowd as crowd_of
from tests.crowds import square
from tests.oracles import complaints

TEE = Workspace(
    boundary=((-3.0, -3.0), (3.0, -3.0), (3.0, 0.7), (-3.0, 0.7)),
    obstacles=(
        ((-3.0, -3.0), (-0.35, -3.0), (-0.35, 0.0), (-3.0, 0.0)),
        ((0.35, -3.0), (3.0, -3.0), (3.0, 0.0), (0.35, 0.0)),
    ),
)
BENT = ((2.5, 0.35), (0.1, 0.35), (0.0, 0.35), (0.0, 0.25), (0.0, -2.6))


def robot(name, start, goal):
    return Robot(
        id=name, start=start, goal=goal, radius=0.2,
        max_speed=0.8, max_accel=0.8, max_lateral_accel=0.8,
    )  # fmt: skip


def test_three_robots_exchange_their_places_at_a_junction():
    places = [(-2.5, 0.35), (2.5, 0.35), (0.0, -2.6)]
    robots = [robot(f"R{k}", places[k], places[(k + 1) % 3]) for k in range(3)]
    scenario = Scenario(name="tee", workspace=TEE, robots=tuple(robots), margin=0.05)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    assert complaints(to_json(plan), scenario) == []


@pytest.mark.parametrize("idle", [False, True])
def test_a_small_robot_makes_room_where_a_wide_one_on_the_floor_has_none(idle):
    """A lane with a side pocket: W passes the small one there, or is idle beside a narrower one."""
    lane = ((0, 0), (8, 0), (8, 1), (4.25, 1), (4.25, 1.6), (3.75, 1.6), (3.75, 1), (0, 1))
    fields = {"max_speed": 0.5, "max_accel": 0.5, "max_lateral_accel": 0.5}
    wide = replace(robot("W", (0.7, 0.5), (7.3, 0.5)), radius=0.4, **fields)
    small = replace(robot("N", (7.3, 0.5), (0.7, 0.5)), radius=0.15, **fields)
    robots = [wide, small]
    if idle:
        lane = (
            *((0, 0), (2, 0), (2, 1.3), (5, 1.3), (5, 0), (7, 0), (7, 3), (5, 3), (5, 1.7)),
            *((3.7, 1.7), (3.7, 2.3), (3.3, 2.3), (3.3, 1.7), (2, 1.7), (2, 3), (0, 3)),
        )
        fields["radius"] = 0.1
        robots = [
            replace(wide, start=(0.6, 0.6), goal=(0.6, 0.6)),
            replace(robot("M", (2.6, 1.5), (4.4, 1.5)), **fields),
            replace(robot("N", (4.4, 1.5), (2.6, 1.5)), **fields),
        ]
    workspace = Workspace(boundary=tuple((float(x), float(y)) for x, y in lane))
    scenario = Scenario(name="lane", workspace=workspace, robots=tuple(robots), margin=0.05)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    assert complaints(to_json(plan), scenario) == []


def test_a_robot_that_rests_for_others_goes_on_when_they_have_passed():
    """R0 has to set out before R4 comes, and not before R1 has: no other time is left."""
    hall = ((0, 0), (3, 0), (3, 1.2), (7, 1.2), (7, 1.8), (3, 1.8), (3, 3), (0, 3))
    xs = [6.7, 6.1, 5.5, 4.9, 4.3]
    slow = {"max_speed": 0.5, "max_accel": 0.5, "max_lateral_accel": 0.5}
    robots = [
        replace(robot(f"R{k}", (x, 1.5), (back, 1.5)), **slow)
        for k, (x, back) in enumerate(zip(xs, xs[::-1], strict=True))
    ]
    workspace = Workspace(boundary=tuple((float(x), float(y)) for x, y in hall))
    scenario = Scenario(name="aisle", workspace=workspace, robots=tuple(robots), margin=0.05)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    arrivals = sorted(one.finish_time for one in plan.robots)
    assert all(stop.depart < arrivals[-2] for one in plan.robots for stop in one.stops)


@pytest.mark.parametrize(
    ("which", "told"),
    [
        (0, {"start": (-2.5, 0.35, 0.5 * math.pi), "goal": (2.5, 0.35, math.pi)}),
        (1, {"start": (2.5, 0.35, 0.0), "goal": (0.0, -2.6, 0.0)}),
        (0, {"via": ((-1.0, 0.3), (1.0, 0.4))}),
        (1, {"via": ((0.1, 0.25),)}),
        (0, {"min_turn_radius": 0.5}),
        (0, {"path": GivenPath(degree=1, control_points=((-2.5, 0.35), (2.5, 0.35)))}),
        (1, {"path": GivenPath(degree=2, control_points=BENT)}),
    ],
)
def test_others_make_room_for_a_robot_that_keeps_to_its_way_or_has_headings(which, told):
    places = [(-2.5, 0.35), (2.5, 0.35), (0.0, -2.6)]
    robots = [robot(f"R{k}", places[k], places[(k + 1) % 3]) for k in range(3)]
    robots[which] = replace(robots[which], **told)
    scenario = Scenario(name="tee", workspace=TEE, robots=tuple(robots), margin=0.05)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    assert complaints(to_json(plan), scenario) == []


def test_two_robots_that_keep_to_one_way_are_named_where_nobody_can_make_room():
    robots = [robot("A", (-2.5, 0.35), (2.5, 0.35)), robot("B", (2.5, 0.35), (-2.5, 0.35))]
    robots = tuple(replace(one, via=((0.0, 0.35),)) for one in robots)
    corridor = Workspace(boundary=((-3.0, 0.0), (3.0, 0.0), (3.0, 0.7), (-3.0, 0.7)))
    scenario = Scenario(name="corridor", workspace=corridor, robots=robots, margin=0.05)
    with pytest.raises(BlockedError) as refused:
        plan_scenario(scenario)
    assert refused.value.kept == ("A", "B")
    assert "A, B do not step aside for others" in str(refused.value)


@pytest.mark.parametrize(("kind", "robots"), [("bays", 3), ("puzzle", 8)])
def test_robots_that_are_in_each_others_way_make_room(kind, robots):
    scenario = generate(kind, robots, 0)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    assert complaints(to_json(plan), scenario) == []
    assert any("make room" in note for note in plan.notes)


def test_many_robots_arrive_earlier_by_moves_that_start_at_times(monkeypatch):
    scenario = generate("aisles", 20, 1)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    assert complaints(to_json(plan), scenario) == []
    monkeypatch.setattr(several_legs, "FEW", 20)
    in_turn = plan_scenario(scenario)
    assert any("make room" in note for note in in_turn.notes)
    early, late = (sum(one.finish_time for one in found.robots) for found in (plan, in_turn))
    assert early < 0.9 * late


def crowd(name, folder):
    """Return 50 robots on a map of MovingAI's kinds, and how long [s] they take straight on."""
    files = folder / "a.map", folder / "a.scen"
    for file, text in zip(files, drawn(name, 50, 0), strict=True):
        file.write_text(text)
    bodies = Bodies(radius=0.35, max_speed=1.0, max_accel=math.inf, tau=0.3, margin=0.05)
    scenario = scenario_of(*files, 50, 1.0, bodies, name)
    speed = scenario.planned_speed(scenario.robots[0])
    return scenario, sum(math.dist(one.start[:2], one.goal[:2]) / speed for one in scenario.robots)


def test_a_crowd_that_would_wait_for_long_makes_room_instead(tmp_path):
    """In an order of robots they would take three times as long as along straight lines."""
    scenario, straight = crowd("room-32-32-4", tmp_path)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    assert sum(one.finish_time for one in plan.robots) < 2.0 * straight


def test_a_robot_that_finds_no_way_at_first_goes_before_those_in_its_way(monkeypatch, tmp_path):
    """In an order of robots they would take 1.8 times as long as along straight lines."""
    monkeypatch.setattr(several_legs, "find_legs", lambda *_: iter(()))
    scenario, straight = crowd("random-32-32-20", tmp_path)
    plan = plan_scenario(scenario)
    assert plan.proof.holds
    assert any("leave their shortest ways" in note for note in plan.notes)
    assert sum(one.finish_time for one in plan.robots) < 1.65 * straight


def test_a_plan_in_which_robots_wait_is_kept_where_making_room_takes_longer(monkeypatch):
    monkeypatch.setattr(planner, "find_flow", lambda *_: None)
    asked, find_legs = [], several_legs.find_legs
    monkeypatch.setattr(several_legs, "find_legs", lambda *a: asked.append(a) or find_legs(*a))
    scenario = generate("rooms", 16, 1)
    compared = plan_scenario(scenario)
    assert len(asked) == 1
    monkeypatch.setattr(several_legs, "find_legs", lambda *_: iter(()))
    assert to_json(plan_scenario(scenario)) == to_json(compared)
    assert compared.proof.holds


@pytest.mark.parametrize(
    ("robots", "seed"),
    [
        (12, 9),  # One rests between two places where another one passes.
        (12, 16),  # One turns round beside a goal that is as near as it may be.
        (16, 7),  # One would set out beside the way of its moves.
    ],
)
def test_where_a_fifth_of_the_floor_is_covered_plans_pass_their_proof(robots, seed):
    side = math.ceil(10.0 * math.sqrt(robots * math.pi * RADIUS**2 / 0.2)) / 10.0
    scenario = generate("dense", robots, seed, (side, side))
    document = plan_scenario(scenario)
    assert document.proof.holds
    assert complaints(to_json(document), scenario) == []


@pytest.mark.parametrize(
    ("side", "radius", "margin", "trips"),
    [
        pytest.param(0.4, 0.05, 0.03, [
            ((0.139, 0.182), (0.097, 0.122)), ((0.305, 0.285), (0.255, 0.21)),
            ((0.305, 0.093), (0.102, 0.305)),
        ], id="one turns back in a corner of the floor"),
        pytest.param(0.84, 0.1, 0.05, [
            ((0.672, 0.624), (0.276, 0.165)), ((0.185, 0.259), (0.583, 0.552)),
            ((0.494, 0.246), (0.658, 0.258)), ((0.307, 0.64), (0.208, 0.641)),
        ], id="places have to be nearer to each other than robots may rest"),
    ],
)  # fmt: skip
def test_few_robots_make_room_on_a_floor_that_is_hardly_large_enough(side, radius, margin, trips):
    robots = crowd_of(trips, radius)
    floor = Workspace(boundary=square(side))
    scenario = Scenario(name="small", workspace=floor, robots=robots, margin=margin)
    document = plan_scenario(scenario)
    assert document.proof.holds
    assert complaints(to_json(document), scenario) == []


@pytest.mark.parametrize("off", [0.0, 0.0001, 0.002])
def test_robots_make_room_around_corners_where_one_stands_flush_with_a_wall(off):
    """They swap the ends of a corridor and pass each other at a bay in its middle."""
    start, end = (0.15 + off, 0.15 + off), (2.83, 0.17)
    swaps = ((start, end), (end, (0.17, 0.17)))
    robots = crowd_of(swaps, 0.1)
    floor = Workspace(
        boundary=((0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (0.0, 1.0)),
        obstacles=(
            ((0.0, 0.5), (1.3, 0.5), (1.3, 1.0), (0.0, 1.0)),
            ((1.7, 0.5), (3.0, 0.5), (3.0, 1.0), (1.7, 1.0)),
        ),
    )
    scenario = Scenario(name="bay", workspace=floor, robots=robots, margin=0.05)
    document = plan_scenario(scenario)
    assert document.proof.holds
    assert complaints(to_json(document), scenario) == []


def test_a_path_that_rests_beside_a_goal_as_near_as_may_be_swings_out_no_nearer():
    """R1 turns at a start that is hardly farther from R2's goal than the two have to be apart."""
    beside = (1.0 + 2.0 * RADIUS + 0.05 + 1e-4, 1.0)
    robots = (robot("R1", (0.5, 1.0), (1.0, 2.0)), robot("R2", (3.0, 0.5), beside))
    robots += (robot("R3", (1.0, 1.0), (3.0, 2.0)),)
    floor = Workspace(boundary=((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)))
    scenario = Scenario(name="near", workspace=floor, robots=robots, margin=0.05)
    ways = [np.array([(0.5, 1.0), (1.0, 1.0)]), np.array([(1.0, 1.0), (1.0, 2.0)])]
    legs = [several_legs.Leg(k, way, {1: (0, 0.0)}) for k, way in enumerate(ways)]
    nearest = []
    for tight in ({}, several_legs._tight(scenario)):
        found = several_legs._along(robots[0], Pathfinder(scenario), 0, legs, tight)
        places = found.path.at_arc(np.linspace(0.0, found.path.length, 3001))
        nearest.append(float(np.hypot(*(places - beside).T).min()))
    assert nearest[0] < 0.449
    assert nearest[1] > 0.45 - 2e-4
