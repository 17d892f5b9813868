"""What operators ask for and cannot have: they are told why, by the name of what is in the way."""

import math

import pytest

from coordinator.scenario.model import Order
from protocol.messages import ORDER_DONE, REFUSED, Block, Unblock
from protocol.messages import Order as Said
from sim.world.run_logs import RunLogs
from tests.scenarios import a_scenario, box
from tests.sim.world.test_odd_operators import reasons
from tests.sim.world.test_orders_in_time import a_world, assert_sound, idle, operator, states

WET = Block(9, "wet", box(10.0, 4.0, 12.0, 6.0))


def a_hall(*, orders=(), size=(14.0, 8.0), **options):
    """R1 and R2 in a hall with a pillar."""
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0))]
    pillar = box(6.0, 3.0, 8.0, 5.0)
    scenario = a_scenario(robots, size=size, obstacles=[pillar], orders=orders)
    return a_world(scenario, **{"stays": True, **options})


def test_an_order_to_a_place_that_is_taken_is_refused_with_the_name_of_what_is_there():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(WET)
    goals = {
        "closed": ((11.0, 5.0), "(11.00, 5.00) is inside the closed place wet"),
        "beside": ((9.9, 5.0), "(9.90, 5.00) is nearer than 0.25 m to the closed place wet"),
        "pillar": ((7.0, 4.0), "R2 cannot be at (7.00, 4.00), which is inside obstacle 0"),
        "edge": (
            (0.1, 4.0),
            "R2 cannot be at (0.10, 4.00), which is nearer than 0.25 m to the floor's edge",
        ),
        "off": ((50.0, 3.0), "R2 cannot be at (50.00, 3.00), which is off the floor"),
    }
    for name, (goal, _) in goals.items():
        say(Said(9, name, goal, robot="R2"))
    world.run(10.0)
    assert set(states(world).values()) == {REFUSED}
    assert reasons(world) == {name: why for name, (_, why) in goals.items()}


def test_an_order_to_where_a_lost_robot_may_stand_waits_and_names_the_robot():
    world = a_hall(faults=["kill:R1@6"], orders=(Order(id="far", goal=(12.0, 1.0)),))
    say = operator(world)
    world.run(40.0)
    x, y, _ = world.robots["R1"].body.true_pose()
    say(Said(9, "there", (x, y), robot="R2"))
    world.run(20.0)
    assert reasons(world)["there"].endswith("which is inside the place where R1 may stand")


@pytest.mark.parametrize("robot", ["", "R2"])
def test_an_order_to_a_closed_place_is_refused_at_once_though_a_robot_rests_there(robot):
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Block(9, "wet", box(0.5, 5.5, 1.5, 6.5)))
    world.run(0.5)
    say(Said(9, "there", (1.0, 6.2), robot=robot))
    say(Said(9, "through", (3.0, 6.2), via=((1.0, 6.2),), robot=robot))
    world.run(0.5)
    for name in ("there", "through"):
        assert states(world)[name] == REFUSED
        assert reasons(world)[name] == "(1.00, 6.20) is inside the closed place wet"


def test_an_order_that_waits_while_its_goal_is_closed_and_opened_again_is_done():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Said(9, "first", (4.0, 1.0), robot="R1"))
    say(Said(9, "second", (11.0, 5.0), robot="R1"))
    world.run(1.0)
    say(WET)
    world.run(1.0)
    say(Unblock(9, "wet"))
    world.run(60.0)
    assert set(states(world).values()) == {ORDER_DONE}


def test_a_robot_whose_goal_is_closed_does_not_drive_there_later_without_its_order(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_hall(logs=logs)
    say = operator(world)
    world.run(2.0)
    say(Said(9, "o1", (11.0, 5.0), robot="R1"))
    world.run(4.0)
    say(WET)
    world.run(6.0)
    say(Unblock(9, "wet"))
    world.run(60.0)
    logs.close()
    assert states(world)["o1"] == REFUSED
    x, y, _ = world.robots["R1"].body.true_pose()
    assert math.dist((x, y), (11.0, 5.0)) > 1.0
    assert states(world)["room-1"] == ORDER_DONE
    assert_sound(world, logs)
