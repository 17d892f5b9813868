"""A refusal is data: who blocks whom, where, whom recovery blames; its sentence is made of that."""

import pickle

import pytest
from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.ground.enclosure import EnclosedError
from coordinator.planning.planner import _Stages, plan_scenario
from coordinator.schedule.refusals import BlockedError, PlaceOnWay, pair_error
from tests.scenarios import a_robot, a_scenario, box

CORRIDOR = [box(0, 0, 10, 3.6), box(0, 4.4, 10, 8)]
YARD = [box(6, 2, 6.3, 6), box(9.3, 2, 9.6, 6), box(6, 2, 9.6, 2.3), box(6, 5.7, 9.6, 6)]


def refusal(robots, **floor):
    with pytest.raises(PlanError) as caught:
        plan_scenario(a_scenario(robots, **floor), effort=0)
    return caught.value


def test_two_that_swap_in_a_corridor_are_named_with_the_places_on_each_others_ways():
    robots = [a_robot("R1", (1, 4), (9, 4)), a_robot("R2", (9, 4), (1, 4))]
    error = refusal(robots, obstacles=CORRIDOR)
    assert isinstance(error, BlockedError)
    assert (error.robots, error.how, error.blames) == (("R1", "R2"), "either order", "R2")
    assert PlaceOnWay("R1", "start", 1, 4, "R2") in error.places
    assert error.place == (9, 4)
    assert str(error).endswith("A wider passage or a place to pass each other would help")


@pytest.mark.parametrize("fields", [{"via": ((1.5, 7.0),)}, {"min_turn_radius": 0.1}])
def test_who_does_not_step_aside_is_named(fields):
    robots = [a_robot("R1", (1, 4), (9, 4)), a_robot("R2", (9, 4), (1, 4))]
    free = a_robot("R3", (1, 7), (2, 7))
    floor = {"obstacles": [box(0, 0, 10, 3.6), box(0, 4.4, 10, 6)]}
    assert "step aside" not in str(refusal([*robots, free], **floor))
    error = refusal([*robots, replace(free, **fields)], **floor)
    assert error.kept == ("R3",)
    assert "R3 does not step aside for others, because of the via points" in str(error)
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.mark.parametrize("width", [0.5, 0.52, 0.55])
def test_a_lane_hardly_wider_than_a_robot_is_refused_as_others_are(width):
    """Between its places no robot can move, so that none can make room."""
    robots = [a_robot("R1", (1, 0.25), (7, 0.25)), a_robot("R2", (4, 0.25), (4, 0.25))]
    error = refusal(robots, size=(8.0, width), margin=0.05)
    assert isinstance(error, BlockedError)
    assert error.robots == ("R1", "R2")
    helps = "Another place for R2, which has no goal, or a wider passage would help"
    assert str(error).endswith(helps)


def test_a_robot_that_is_closed_in_is_blamed_with_the_radius_that_would_pass():
    walls = [box(5, 0, 5.5, 3.85), box(5, 4.15, 5.5, 8)]
    error = refusal([a_robot("R1", (1, 4), (9, 4))], obstacles=walls)
    assert isinstance(error, EnclosedError)
    assert (error.robot, error.blames, error.place) == ("R1", "R1", (9, 4))
    assert error.radius == pytest.approx(0.1, abs=1e-3)
    assert str(error).startswith("R1: has no way from (1.00, 4.00) to (9.00, 4.00)")
    assert not error.sentence.startswith("R1")


def test_a_yard_without_a_gate_lets_no_radius_pass():
    error = refusal([a_robot("R1", (1, 4), (8, 4))], obstacles=YARD)
    assert not error.radius


def test_a_robot_that_brakes_for_minutes_is_blamed_without_being_the_only_one_concerned():
    slow = a_robot("R1", (1, 4), (9, 4), max_speed=1.0, max_accel=0.001)
    error = refusal([slow, a_robot("R2", (1, 1), (9, 1))], tau="auto")
    assert (error.robot, error.blames) == ("", "R1")
    assert error.helps == "a larger max_accel or a tau by hand"


def test_a_refusal_goes_from_one_process_to_another():
    error = BlockedError(["A", "B"], "no order", [PlaceOnWay("A", "start", 1.0, 2.0, "B")], False)
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.blames, again.places) == (str(error), "B", error.places)


def said_of(*robots, size=(10.0, 8.0), **how):
    scenario = a_scenario(robots, size)
    stages = _Stages(scenario, 0.5, None)
    stages.find_paths()
    stages.find_zones(effort=0)
    error = pair_error(scenario, stages.junctions, (0, 1), **how)
    assert error.blames in {robot.id for robot in robots}
    return str(error)


def test_facts_that_ask_for_one_order_are_no_reason_against_both():
    robots = [a_robot("A", (1, 0.5), (6, 0.5)), a_robot("B", (3, 0.5), (9, 0.5))]
    said = said_of(*robots, size=(10.0, 1.0))
    assert "whoever goes first" not in said
    assert said.startswith("no order was found in which A and B both arrive: ")
    assert "B's start (3.00, 0.50) lies on A's way" in said
    assert "A's goal (6.00, 0.50) lies on B's way" in said


def test_robots_without_places_on_each_others_ways_are_said_to_come_near():
    said = said_of(a_robot("A", (1, 4), (9, 4)), a_robot("B", (5, 1), (5, 7)))
    assert "whoever goes first" not in said
    assert "A and B come near each other on their ways" in said


@pytest.mark.parametrize("names", ["AB", "BA"])
def test_facts_that_ask_for_both_orders_are_told_as_such(names):
    robots = [a_robot("A", (1, 4), (9, 4)), a_robot("B", (9, 4), (1, 4))]
    said = said_of(*sorted(robots, key=lambda robot: names.index(robot.id)))
    assert "block each other whoever goes first" in said
    assert "A's start (1.00, 4.00) lies on B's way" in said
    assert "B's start (9.00, 4.00) lies on A's way" in said


def test_what_two_robots_could_do_alone_is_not_said_to_be_impossible():
    robots = [a_robot("A", (1, 4), (9, 4)), a_robot("B", (9, 4), (1, 4))]
    said = said_of(*robots, among_others=True)
    assert said.startswith("no order of the whole fleet was found in which A and B both arrive: ")
