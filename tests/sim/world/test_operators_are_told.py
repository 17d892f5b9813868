"""What operators ask for and cannot have: they are told why, by the name of what is in the way."""

from coordinator.scenario.model import Order
from protocol.messages import REFUSED, Block
from protocol.messages import Order as Said
from tests.scenarios import a_scenario, box
from tests.sim.world.test_odd_operators import reasons
from tests.sim.world.test_orders_in_time import a_world, idle, operator, states

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
        "closed": ((11.0, 5.0), "is inside the closed place wet"),
        "beside": ((9.9, 5.0), "is nearer than 0.25 m to the closed place wet"),
        "pillar": ((7.0, 4.0), "is inside obstacle 0"),
        "edge": ((0.1, 4.0), "is nearer than 0.25 m to the floor's edge"),
        "off": ((50.0, 3.0), "is off the floor"),
    }
    for name, (goal, _) in goals.items():
        say(Said(9, name, goal, robot="R2"))
    world.run(10.0)
    assert set(states(world).values()) == {REFUSED}
    for name, ((x, y), what) in goals.items():
        assert reasons(world)[name] == f"R2 cannot be at ({x:.2f}, {y:.2f}), which {what}"


def test_an_order_to_where_a_lost_robot_may_stand_waits_and_names_the_robot():
    world = a_hall(faults=["kill:R1@6"], orders=(Order(id="far", goal=(12.0, 1.0)),))
    say = operator(world)
    world.run(40.0)
    x, y, _ = world.robots["R1"].body.true_pose()
    say(Said(9, "there", (x, y), robot="R2"))
    world.run(20.0)
    assert reasons(world)["there"].endswith("which is inside the place where R1 may stand")
