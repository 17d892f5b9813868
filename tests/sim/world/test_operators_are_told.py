"""What operators ask for and cannot have: they are told why, by the name of what is in the way."""

import math

import pytest
import shapely

from coordinator.findings.log_proof import prove_log
from coordinator.fleet.admit_outcome import Asking
from coordinator.fleet.hold_reasons import missing_in_words
from coordinator.log.log_file import read_log
from coordinator.mission.aside_news import AsideNews
from coordinator.scenario.model import Order
from coordinator.service.replay import check_log
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    CANCELLED,
    END,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    Admit,
    Block,
    Join,
    Leave,
    Tell,
    Unblock,
)
from protocol.messages import Order as Said
from protocol.phases import IDLE, OFF_PATH
from protocol.timing import SECOND
from sim.world.fault_text import Fault
from sim.world.run_logs import RunLogs
from tests.scenarios import a_robot, a_scenario, box
from tests.sim.world.test_odd_operators import reasons
from tests.sim.world.test_orders_in_time import (
    a_world,
    admit,
    assert_sound,
    idle,
    operator,
    states,
)

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
        "pillar": (
            (7.0, 4.0),
            "R2 cannot be at (7.00, 4.00), which is inside workspace.obstacles[0]",
        ),
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


def test_an_order_into_a_place_that_is_closed_around_its_robot_is_refused_and_the_robot_leaves(
    tmp_path,
):
    logs = RunLogs(tmp_path)
    world = a_hall(logs=logs)
    say = operator(world)
    around = box(0.1, 0.1, 3.6, 1.9)
    world.run(2.0)
    say(Said(9, "o1", (3.0, 1.0), robot="R1"))
    world.run(1.0)
    say(Block(9, "wet", around))
    world.run(40.0)
    logs.close()
    assert states(world)["o1"] == REFUSED
    assert reasons(world)["o1"].endswith("is inside the closed place wet")
    place = shapely.Point(world.robots["R1"].body.true_pose()[:2])
    assert shapely.distance(shapely.Polygon(around), place) > 0.2
    assert_sound(world, logs)


def comes_back(world, name, place, boot=78):
    """Start a killed robot's program with this place; an operator asks until there is an outcome.

    Return that outcome.
    """
    session = world._network.session(f"operator {boot}")
    asking = Asking(name, boot)

    def hear(key, payload, _):
        message = decode(keys.split(key)[1], payload)
        if not asking.answer:
            asking.hear(message)

    for key in (keys.plan(world.fleet.name, name), keys.command(world.fleet.name)):
        session.subscribe(key, hear)
    world.renew(name, boot, place)
    world.run(1.0)
    for _ in range(100):
        if asking.answer:
            break
        asking.asked()
        session.put(keys.admit(world.fleet.name, name), encode(Admit(boot)))
        world.run(0.2)
    return asking


def one_killed(logs, **options):
    """R1 has an order and is killed under way to it; R2 rests."""
    orders = (Order(id="far", goal=(12.0, 1.0), robot="R1", release=1.0),)
    world = a_hall(orders=orders, faults=["kill:R1@6"], logs=logs, **options)
    world.run(9.0)
    return world


@pytest.mark.parametrize(
    ("place", "why"),
    [
        (
            (7.0, 4.0),
            "R1 says that it stands at (7.00, 4.00), which is inside workspace.obstacles[0]",
        ),
        ((50.0, 1.0), "R1 says that it stands at (50.00, 1.00), which is off the floor"),
        ((1.0, 6.0), "R1 says that it stands at (1.00, 6.00), where R2 stands"),
        ((1.1, 6.0), "R1 says that it stands at (1.10, 6.00), where R2 stands"),
        ((1.43, 6.0), "R1 says that it stands at (1.43, 6.00), too near to R2"),
    ],
)
def test_a_robot_is_not_admitted_where_it_cannot_stand_and_the_operator_is_told_why(
    tmp_path, place, why
):
    logs = RunLogs(tmp_path)
    world = one_killed(logs)
    x, y, heading = world.robots["R1"].body.true_pose()
    asking = comes_back(world, "R1", (*place, 0.0))
    todo = "start its program again with the place where it stands"
    assert (asking.admitted, asking.answer) == (False, f"{why}; {todo}")
    world.run(5.0)
    told = [one.text for one in world.fleet.incidents]
    assert asking.answer in told
    assert "R1 is admitted" not in told
    assert world.fleet.grants.of("R2").newest.revision == 0
    assert comes_back(world, "R1", (x, y, heading), boot=79).admitted
    assert [one.text for one in world.fleet.incidents].count("R1 is admitted") == 1
    world.run(40.0)
    logs.close()
    assert states(world)["far"] == ORDER_DONE
    log = read_log(logs.paths[-1])
    assert (check_log(log).difference, prove_log(log).holds) == ("", True)


def test_a_robot_that_is_being_admitted_is_not_to_be_started_and_admitted():
    world = one_killed(None)
    news, told = AsideNews(), []
    x, y, heading = world.robots["R1"].body.true_pose()
    world.renew("R1", 78, (x, y, heading))
    world.run(1.0)
    admit(world, "R1")
    for _ in range(200):
        world.step()
        told += news.news(world.mission, world.now_ns)
    assert told == []
    assert "R1 is admitted" in [one.text for one in world.fleet.incidents]


def test_a_robot_whose_program_was_started_again_is_to_be_admitted_not_started():
    world = one_killed(None)
    world.renew("R1", 78, world.robots["R1"].body.true_pose())
    news, told = AsideNews(), []
    while not told and world.now_ns < 100 * SECOND:
        world.run(1.0)
        told += news.news(world.mission, world.now_ns)
    ((robot, text),) = told
    assert robot == "R1"
    assert "`splinefleet admit R1 --connect ...`, or carry it away" in text
    assert "start its program" not in text


def test_a_robot_that_may_still_set_out_does_not_leave():
    """It is let in, does not stand where its course begins, and may be put there at any time."""
    world = one_killed(None)
    say = operator(world)
    pose, member = world.robots["R1"].body.true_pose(), world.fleet.members["R1"]
    x, y, heading = pose
    world.renew("R1", 78, pose)
    world.run(1.0)
    admit(world, "R1")
    while not (member.planned and member.phase == IDLE and member.fault == OFF_PATH):
        if member.came_back_to is not None:
            world.robots["R1"].body.place(x, y + 0.5, heading)
        world.step()
    world.run(0.5)
    say(Leave(9, "R1"))
    world.run(0.5)
    why = "R1 does not rest; if it cannot get on, end its program first"
    assert reasons(world)["leave-R1"] == why
    world.robots["R1"].body.place(*pose)
    world.run(20.0)
    assert states(world)["far"] == ORDER_DONE


def test_the_orders_of_a_lost_robot_say_that_it_is_lost():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Block(9, "wet", box(0.2, 5.0, 9.0, 7.5)))
    world.run(2.0)
    assert states(world)["room-1"] == UNDER_WAY
    say(Said(9, "next", (11.0, 5.0), robot="R2"))
    world.run(0.5)
    assert reasons(world)["next"] == "R2 does room-1 first"
    world.strike(Fault("kill", "R2", 0.0, 0.0))
    while not world.fleet.members["R2"].lost:
        world.step()
    world.run(0.5)
    assert states(world)["room-1"] == UNDER_WAY
    assert reasons(world)["next"] == "R2 is lost"
    say(Tell(9, END))
    world.run(60.0)
    assert states(world) == {"room-1": REFUSED, "next": REFUSED}
    assert reasons(world) == {"room-1": "R2 is lost", "next": "R2 is lost"}


@pytest.mark.parametrize(("after", "state"), [(1.0, CANCELLED), (100.0, REFUSED)])
def test_a_robot_that_is_taken_out_before_it_was_heard_has_not_joined(after, state):
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Join(9, "R9", (10.0, 2.0, 0.0), 0.25, 0.8))
    world.run(after)
    say(Leave(9, "R9"))
    world.run(1.0)
    assert states(world) == {"join-R9": state, "leave-R9": ORDER_DONE}


def test_a_robot_that_cannot_join_beside_one_that_leaves_is_told_of_that_one():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Said(9, "far", (12.0, 1.0), robot="R1"))
    while not world.robots["R1"].body.true_pose()[0] > 1.2:
        world.run(0.1)
    say(Join(9, "R9", (1.4, 1.0, 0.0), 0.25, 0.8))
    world.run(1.0)
    assert states(world)["join-R9"] == REFUSED
    told = "R9 cannot stand there: R1 still drives too near; ask again when it has passed"
    assert reasons(world)["join-R9"] == told


def test_a_place_that_is_closed_off_the_floor_is_noted():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Block(9, "far", box(33.0, 1.0, 34.0, 2.0)))
    say(WET)
    world.run(2.0)
    told = [one.text for one in world.fleet.incidents if one.kind == "block"]
    assert [text for text in told if "off the floor" in text] == [
        "far lies off the floor: nobody drives there anyway"
    ]


def test_who_is_held_by_one_that_stands_before_a_closed_place_is_told_so():
    """R1 crosses the hall ahead of R2, which goes up; a place before that is closed."""
    robots = [
        a_robot("R1", (1.0, 3.0), (13.0, 3.0), max_speed=0.5),
        a_robot("R2", (9.0, 1.0), (9.0, 5.0), max_speed=0.08),
    ]
    world = a_world(a_scenario(robots, size=(14.0, 6.0)))
    world.run(8.0)
    operator(world)(Block(9, "wet", box(7.5, 0.0, 7.8, 6.0)))
    said = set()
    for _ in range(40):
        world.run(1.0)
        said.add(missing_in_words(world.fleet, world.now_ns))
    assert "R2: held by R1, which stands before a closed place" in said


def test_a_robot_that_was_taken_out_and_could_not_join_again_still_counts_as_heard_outside():
    world = a_hall()
    say = operator(world)
    world.run(4.0)
    say(Leave(9, "R2"))
    world.run(2.0)
    assert world.now_ns - world.fleet.outside_ns["R2"] < SECOND
    world.renew("R2", 78, (1.0, 6.0, 0.0))
    say(Join(9, "R2", (1.2, 1.0, 0.0), 0.2, 0.8))
    world.run(3.0)
    assert states(world)["join-R2"] == REFUSED
    assert "R2" not in world.fleet.members
    assert world.now_ns - world.fleet.outside_ns["R2"] < SECOND
    say(Join(9, "R2", (1.0, 6.0, 0.0), 0.2, 0.8))
    world.run(3.0)
    assert "R2" in world.fleet.members
    assert world.fleet.outside_ns == {}
