"""Whole plans: either a sentence that names a robot, or a document that dense sampling accepts."""

import functools
import itertools
import os
import subprocess
import sys

import pytest
from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.plan.plan_file import from_json, to_json
from coordinator.planning.planner import DEFAULT_EFFORT, LATER_EFFORT, plan_scenario
from coordinator.proof.verify import prove_document
from coordinator.scenario.checks import find_problems
from sim.floors.generator import generate
from tests.oracles import complaints, tracks
from tests.scenarios import a_robot, a_scenario, box, random_scenario
from tests.sweeps import seeds

SEEDS = seeds(36)


def planned(scenario):
    """The document of a scenario, or the error's text."""
    try:
        return plan_scenario(scenario, effort=5)
    except PlanError as error:
        return str(error)


@functools.cache
def outcome(seed):
    """The document of a random scenario, or the error's text."""
    return planned(random_scenario(seed))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_plan_keeps_all_that_was_asked_or_the_error_names_a_robot(seed):
    scenario, found = random_scenario(seed), outcome(seed)
    if isinstance(found, str):
        assert any(robot.id in found for robot in scenario.robots)
        assert "proof" not in found
        return
    assert complaints(to_json(found), scenario) == []
    again = from_json(to_json(found))
    for proof in (prove_document(again), prove_document(again, scenario)):
        assert proof.holds, proof.failures
        assert proof.least_separation == found.proof.least_separation
        assert proof.least_clearance == found.proof.least_clearance


def test_most_random_scenarios_are_planned():
    assert sum(not isinstance(outcome(seed), str) for seed in SEEDS) >= 0.6 * len(SEEDS)


def test_the_same_scenario_gives_the_same_bytes_in_every_process():
    script = (
        "import sys; from tests.scenarios import random_scenario;"
        "from coordinator.planning.planner import plan_scenario;"
        "from coordinator.plan.plan_file import to_json;"
        "plan = plan_scenario(random_scenario(int(sys.argv[1])), effort=5);"
        "sys.stdout.buffer.write(to_json(plan))"
    )
    seed = next(seed for seed in SEEDS if not isinstance(outcome(seed), str))
    environment = os.environ | {"PYTHONHASHSEED": "7", "PYTHONPATH": os.getcwd()}
    command = [sys.executable, "-c", script, str(seed)]
    other = subprocess.run(command, env=environment, capture_output=True, check=True).stdout
    assert replace(from_json(other), timing={}) == replace(outcome(seed), timing={})
    assert to_json(replace(from_json(other), timing={})) == to_json(
        replace(outcome(seed), timing={})
    )


def swap(size, obstacles=(), **fields):
    y = 0.5 * size[1]
    robots = [
        a_robot("A", (1.0, y), (size[0] - 1.0, y), **fields),
        a_robot("B", (size[0] - 1.0, y), (1.0, y), **fields),
    ]
    return a_scenario(robots, size, obstacles)


def test_two_robots_that_swap_places_in_the_open_succeed():
    scenario = swap((10.0, 8.0))
    document = plan_scenario(scenario)
    assert complaints(to_json(document), scenario) == []
    assert any("keeps beside" in note for note in document.notes)


def test_a_corridor_too_narrow_to_pass_names_both_robots():
    with pytest.raises(PlanError) as caught:
        plan_scenario(swap((10.0, 0.8)))
    assert "A" in str(caught.value)
    assert "B" in str(caught.value)
    assert "wider" in str(caught.value)


def test_an_enclosed_goal_names_the_robot_and_the_obstacle():
    walls = [box(6, 2, 9, 2.3), box(6, 4.7, 9, 5), box(6, 2, 6.3, 5), box(8.7, 2, 9, 5)]
    robots = [a_robot("Ann", (1, 1), (7.5, 3.5)), a_robot("Bob", (1, 6), (4, 6))]
    with pytest.raises(PlanError, match=r"Ann: has no way from .* to \(7\.50, 3\.50\)") as caught:
        plan_scenario(a_scenario(robots, obstacles=walls))
    assert "workspace.obstacles[0]" in str(caught.value)


def test_what_closes_a_robot_in_is_named_with_a_wide_margin_too():
    walls = [box(0.0, 2.5, 2.5, 2.7), box(2.5, 0.0, 2.7, 2.7)]
    robots = [a_robot("Ann", (1, 1), (5, 5), radius=0.1)]
    with pytest.raises(PlanError, match=r"obstacles\[0\] and workspace\.obstacles\[1\]"):
        plan_scenario(a_scenario(robots, obstacles=walls, margin=0.4))


def test_a_gap_for_one_is_passed_one_after_the_other():
    walls = [box(4.8, 0.0, 5.2, 3.6), box(4.8, 4.4, 5.2, 8.0)]
    robots = [a_robot(f"R{i}", (1.0, 1.0 + 2 * i), (9.0, 7.0 - 2 * i)) for i in range(4)]
    scenario = a_scenario(robots, obstacles=walls)
    document = plan_scenario(scenario)
    assert complaints(to_json(document), scenario) == []
    passing = []
    for track in tracks(to_json(document)):
        end = int(track.finish / 0.02)
        x = track.at([0.02 * k for k in range(end)])[:, 0]
        passing.append(0.02 * int((x > 5.0).argmax()))
    passing.sort()
    assert all(b - a > document.tau for a, b in itertools.pairwise(passing))


def test_a_plan_for_one_robot_needs_no_others():
    scenario = a_scenario([a_robot("A", (1, 1), (9, 7), via=((5, 2),))])
    document = plan_scenario(scenario)
    assert document.proof.least_separation is None
    assert complaints(to_json(document), scenario) == []


def test_a_path_too_long_for_a_message_is_refused_with_a_sentence():
    vias = tuple((1.0 + 0.06 * i, 2.0 + 3.0 * (i % 2)) for i in range(130))
    with pytest.raises(PlanError, match=r"A: .*; fewer via points would help"):
        plan_scenario(a_scenario([a_robot("A", (0.5, 1), (9.5, 1), via=vias)]))


def test_a_plan_that_lasts_for_hours_is_proven_too():
    robots = [
        a_robot("A", (1, 1), (9, 7), max_speed=0.001, max_accel=1.0),
        a_robot("B", (1, 7), (9, 1), max_speed=0.0015, max_accel=1.0),
    ]
    assert plan_scenario(a_scenario(robots)).proof.holds


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"max_accel": 4e-3}, "B brakes for 200 s, .* at most 120 s"),
        ({"max_speed": 4e-4}, "B arrives after .* at most 20000 s"),
    ],
)
def test_a_robot_too_slow_for_any_plan_is_named(fields, words):
    robots = [a_robot("A", (1, 1), (9, 7)), a_robot("B", (1, 7), (9, 1), **fields)]
    with pytest.raises(PlanError, match=words):
        plan_scenario(a_scenario(robots, tau=1.0 if "max_speed" in fields else "auto"))


def test_a_turning_radius_is_kept_at_via_points_too():
    robot = a_robot("A", (1, 1), (8, 5), via=((4.0, 1.5), (5.0, 3.0)), min_turn_radius=0.25)
    scenario = a_scenario([robot])
    document = plan_scenario(scenario)
    assert complaints(to_json(document), scenario) == []


@pytest.mark.parametrize("effort", [0, 40])
def test_effort_changes_times_but_never_safety(effort):
    scenario = random_scenario(17)
    assert complaints(to_json(plan_scenario(scenario, effort=effort)), scenario) == []


def test_priorities_that_no_order_keeps_are_told_in_the_notes():
    def notes(first, second):
        robots = [
            a_robot("A", (1, 0.45), (7, 0.45), max_speed=0.8, priority=first),
            a_robot("B", (3, 0.45), (11, 0.45), max_speed=0.2, priority=second),
        ]
        return plan_scenario(a_scenario(robots, size=(12.0, 0.9)), effort=3).notes

    told = [note for note in notes(5, 2) if "priorities" in note]
    sentence = "priorities are not kept, no order was found that keeps them: A (5) waits for B (2)"
    assert told == [sentence]
    assert not any("priorities" in note for note in (*notes(0, 0), *notes(2, 5)))


def test_later_epochs_are_searched_no_longer_than_a_standing_fleet_should_wait():
    def found(effort, epoch):
        plan = plan_scenario(scenario, effort=effort, epoch=epoch)
        return replace(plan, timing={}, epoch=1, proof=None).robots

    scenario = generate("open", 17, 1)
    assert found(DEFAULT_EFFORT, 2) == found(LATER_EFFORT, 1) != found(DEFAULT_EFFORT, 1)
    assert found(1, 2) == found(1, 1)


@pytest.mark.parametrize("spare", [0.0, 0.0005, 0.001])
def test_a_place_in_a_passage_as_narrow_as_its_robots_is_passed_before_it_is_taken(spare):
    low, high = 4.55, 5.45 + spare
    walls = [box(4.0, 0.0, 12.0, low), box(4.0, high, 12.0, 10.0)]
    robots = [
        a_robot("A", (2.0, 4.0), (14.0, 6.0), radius=0.4),
        a_robot("B", (2.0, 6.0), (8.0, 0.5 * (low + high)), radius=0.4),
    ]
    plan = plan_scenario(a_scenario(robots, (16.0, 10.0), walls, margin=0.05))
    assert plan.proof.holds
    assert any("A's path crosses B's goal" in note for note in plan.notes)


def test_three_robots_drive_among_two_idle_ones_and_the_plan_holds():
    made = a_scenario(
        [
            a_robot("R1", (0.6, 2.0), (4.4, 2.0)),
            a_robot("R2", (2.0, 0.6), (2.0, 4.4)),
            a_robot("R3", (4.4, 4.7), (1.0, 1.0)),
            a_robot("I1", (3.0, 2.0), (3.0, 2.0)),
            a_robot("I2", (2.0, 3.0, 2.0), (2.0, 3.0, 2.0), max_accel=float("inf")),
        ],
        size=(5.0, 5.2),
    )
    document = plan_scenario(made)
    assert document.proof.holds
    assert complaints(to_json(document), made) == []
    assert prove_document(from_json(to_json(document)), made).holds
    for name in ("I1", "I2"):
        robot = document.robot(name)
        assert 0.0 < robot.length < 1e-3
        assert robot.stops == []
        assert robot.finish_time < 0.2


def test_a_fleet_that_is_all_idle_is_planned():
    rows = [(1.0 + 0.45 * (i % 4), 1.0 + 0.45 * (i // 4)) for i in range(16)]
    made = a_scenario([a_robot(f"I{i}", place, place) for i, place in enumerate(rows)])
    document = plan_scenario(made)
    assert document.proof.holds
    assert document.notes == []


@pytest.mark.parametrize("seed", seeds(12))
def test_some_robots_of_random_scenarios_may_be_idle(seed):
    scenario = random_scenario(seed)
    robots = [replace(r, goal=r.start, via=()) for r in scenario.robots[::2]]
    made = replace(scenario, robots=(*robots, *scenario.robots[1::2]))
    found = "R: refused" if find_problems(made) else planned(made)
    if isinstance(found, str):
        assert "R" in found
        assert "proof" not in found
    else:
        assert complaints(to_json(found), made) == []
        assert prove_document(from_json(to_json(found)), made).holds


def test_an_idle_robot_in_the_only_way_is_named_with_its_place():
    walls = [box(0.0, 0.0, 10.0, 3.7), box(0.0, 4.3, 10.0, 8.0)]
    drives, idle = a_robot("R1", (1.0, 4.0), (9.0, 4.0)), a_robot("R2", (5.0, 4.0), (5.0, 4.0))
    with pytest.raises(PlanError) as caught:
        plan_scenario(a_scenario([drives, idle], obstacles=walls))
    assert str(caught.value).startswith(
        "on the ways that were found, R1 and R2 block each other whoever goes first: R2's place "
        "(5.00, 4.00) lies on R1's way;"
    )
    assert caught.value.blames == "R1"
