"""Fleets in virtual time that get orders while they drive, judged by their true places."""

import math

import pytest
import shapely
from msgspec.structs import replace

from coordinator.findings.log_proof import prove_log
from coordinator.log.log_file import logs_before, read_log
from coordinator.mission import making_room
from coordinator.mission.aside_news import AsideNews
from coordinator.mission.obstructions import Obstructions
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Demand, Order
from coordinator.schedule.authority import Authority
from coordinator.service.replay import check_log
from coordinator.view.scene_log import scene_of_logs
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    CANCELLED,
    END,
    GO_ON,
    HALT,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    Admit,
    Block,
    Cancel,
    Join,
    Leave,
    Tell,
    Unblock,
)
from protocol.messages import Order as Said
from protocol.phases import FREEZE, GO, OVER, STOP
from sim.campaigns.truth import touches
from sim.floors.generator import generate
from sim.judging.judge import least_separation
from sim.world.fault_script import read_faults
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import USUAL_FLAWS, World
from tests.scenarios import a_robot, a_scenario, box

PERIOD_NS = 20_000_000


def idle(name, start, **fields):
    return replace(a_robot(name, start, start), **fields)


def a_world(scenario, *, faults=(), seed=1, network=None, flaws=USUAL_FLAWS, **options):
    document = plan_scenario(scenario, effort=0)
    names = [robot.id for robot in scenario.robots]
    return World(
        scenario,
        document,
        network or MemoryNetwork(seed),
        seed=seed,
        faults=read_faults(list(faults), names),
        flaws=flaws,
        period_ns=PERIOD_NS,
        **options,
    )


def nobody_touches(world):
    return touches(world.mission.documents[1], world.blackboxes(), ()) == []


def assert_sound(world, logs):
    """Nobody touches, and the log gives the same bytes again and is proven at every moment."""
    assert nobody_touches(world)
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log).holds


def states(world):
    return {name: task.state for name, task in world.fleet.orders.tasks.items()}


def freezes(world):
    return sum(one.phase == FREEZE for one in world.fleet.incidents)


def operator(world):
    """What sends an operator's message to a fleet."""
    session = world._network.session("operator")
    fleet = world.fleet.name

    def say(message):
        kinds = {Tell: keys.tell, Block: keys.block, Unblock: keys.block}
        kinds |= {Join: keys.roster, Leave: keys.roster}
        session.put(kinds.get(type(message), keys.order)(fleet), encode(message))

    return say


@pytest.mark.parametrize("kind", ["open", "warehouse", "rooms"])
def test_a_day_of_orders_is_done_without_a_freeze_and_nobody_touches(kind):
    made = generate(kind, 6, 3)
    docks = tuple(place[:2] for one in made.robots for place in (one.start, one.goal))
    robots = tuple(replace(one, goal=one.start, via=()) for one in made.robots)
    demand = Demand(places=docks, per_robot=3, first_within=5.0, seed=1)
    world = a_world(replace(made, robots=robots, demand=demand))
    world.run(600.0)
    assert world.fleet.is_finished
    assert set(states(world).values()) == {ORDER_DONE}
    assert sum(name.startswith("R") for name in states(world)) == 18
    assert freezes(world) == 0
    assert nobody_touches(world)


def hall(**fields):
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0)), a_robot("R3", (8.0, 1.0), (8.0, 6.0))]
    return a_scenario(robots, **fields)


def test_the_log_of_a_day_can_be_run_again_and_is_proven_at_every_moment(tmp_path):
    orders = (
        Order(id="a", goal=(8.0, 3.0), robot="R1", dwell=1.0),
        Order(id="b", goal=(1.0, 3.0), robot="R3", release=3.0, via=((5.0, 5.0),)),
        Order(id="c", goal=(8.0, 1.0), after="a"),
    )
    scenario = replace(hall(), orders=orders)
    logs = RunLogs(tmp_path)
    world = a_world(scenario, logs=logs, faults=["coordinator-restart@14:3"])
    world.run(200.0)
    logs.close()
    assert states(world) == dict.fromkeys("abc", ORDER_DONE)
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    proof = prove_log(log, before=logs_before(log))
    assert proof.holds
    assert [epoch.courses for epoch in proof.epochs] == [3]


def test_a_course_among_others_that_were_left_out_of_its_search_is_not_proven(tmp_path):
    """What the dispatcher would send if it did not know the others."""
    robots = [idle("R1", (1.0, 3.0)), a_robot("R2", (4.5, 0.6), (4.5, 6.4))]
    orders = (Order(id="a", goal=(8.0, 3.0), robot="R1"),)
    logs = RunLogs(tmp_path)
    world = a_world(a_scenario(robots, orders=orders), logs=logs)
    world.fleet.grants.possible = list
    world.run(60.0)
    logs.close()
    proof = prove_log(read_log(logs.paths[-1]))
    assert not proof.holds
    (epoch,) = proof.epochs
    assert any(one.startswith("course 1 of R1 in epoch 1: ") for one in epoch.failures)


def a_lane():
    """A hall of two rooms with a lane between them."""
    return replace(
        hall().workspace,
        obstacles=(
            ((3.0, 0.0), (7.0, 0.0), (7.0, 3.0), (3.0, 3.0)),
            ((3.0, 4.0), (7.0, 4.0), (7.0, 8.0), (3.0, 8.0)),
        ),
    )


def test_an_order_for_which_others_make_room_again_and_again_is_refused(monkeypatch):
    monkeypatch.setattr(making_room, "_MOST_ROOMS", 0)
    robots = [idle("R1", (1.0, 3.5)), idle("R2", (5.0, 3.5), home=(9.0, 1.0))]
    order = Order(id="through", goal=(9.0, 3.5), robot="R1")
    world = a_world(replace(a_scenario(robots), workspace=a_lane(), orders=(order,)))
    world.run(60.0)
    assert world.fleet.is_finished
    task = world.fleet.orders.tasks["through"]
    assert task.state == REFUSED
    assert task.reason == ("R1 has no way: others made room 0 times, and R2 is in the way again")


def test_a_robot_in_the_way_makes_room_and_two_that_swap_places_do_so():
    robots = [
        idle("R1", (1.0, 3.5)),
        idle("R2", (5.0, 3.5), home=(9.0, 1.0)),
        idle("R3", (1.0, 6.0)),
    ]
    orders = (
        Order(id="through", goal=(9.0, 3.5), robot="R1"),
        Order(id="there", goal=(1.0, 3.5), robot="R3", release=0.5),
    )
    scenario = replace(a_scenario(robots), workspace=a_lane(), orders=orders)
    world = a_world(scenario)
    world.run(300.0)
    assert world.fleet.is_finished
    assert {states(world)[name] for name in ("through", "there")} == {ORDER_DONE}
    assert any(one.text == "R2 makes room for through" for one in world.fleet.incidents)
    assert world.robots["R2"].body.x == pytest.approx(9.0, abs=0.02)
    assert nobody_touches(world)


def test_orders_are_redirected_cancelled_refused_and_the_fleet_stops_goes_on_and_ends():
    world = a_world(hall(), stays=True)
    say = operator(world)
    world.run(12.0)
    assert world.fleet.phase == GO  # Everybody rests, and the fleet waits for orders.
    say(Said(9, "first", (8.0, 3.0), robot="R1"))
    say(Said(9, "nowhere", (50.0, 3.0)))
    world.run(4.0)
    say(Said(9, "urgent", (1.0, 3.5), robot="R1", now=True))
    say(Said(9, "back", (8.0, 1.5), robot="R2"))
    world.run(4.0)
    say(Cancel(9, "back"))
    world.run(1.0)
    say(Tell(9, HALT))
    world.run(0.5)
    assert world.fleet.phase == STOP
    say(Tell(9, GO_ON))
    world.run(40.0)
    assert not world.fleet.is_finished
    say(Tell(9, END))
    world.run(5.0)
    found = states(world)
    assert (found["first"], found["urgent"]) == (ORDER_DONE, ORDER_DONE)
    assert (found["nowhere"], found["back"]) == (REFUSED, CANCELLED)
    tasks = world.fleet.orders.tasks
    assert tasks["urgent"].arrived_ms < tasks["first"].arrived_ms
    assert world.fleet.phase == OVER
    assert freezes(world) == 0
    assert nobody_touches(world)


def test_an_urgent_order_that_comes_between_go_and_time_zero_is_done_at_once():
    robots = [a_robot("R1", (1.0, 1.0), (9.0, 1.0)), a_robot("R2", (1.0, 5.0), (9.0, 5.0))]
    world = a_world(a_scenario(robots, size=(10.0, 6.0)), stays=True)
    while not world.fleet.has_gone:
        world.step()
    assert world.fleet.since_go_ms(world.now_ns) < 0
    operator(world)(Said(9, "now", (5.0, 3.0), robot="R1", now=True))
    world.run(3.0)
    assert states(world)["now"] == UNDER_WAY
    world.run(20.0)
    assert states(world)["now"] == ORDER_DONE
    assert nobody_touches(world)


def test_an_order_for_later_waits_and_is_refused_by_a_fleet_that_ends():
    world = a_world(hall(), stays=True)
    say = operator(world)
    world.run(12.0)
    say(Said(9, "last", (8.0, 3.0), robot="R1"))
    say(Said(9, "next", (1.0, 3.5), robot="R1", after="last"))
    world.run(2.0)
    assert states(world) == {"last": UNDER_WAY}
    say(Tell(9, END))
    world.run(1.0)
    say(Said(9, "never", (1.0, 6.0), after="next"))
    world.run(60.0)
    done = {"last": ORDER_DONE, "next": ORDER_DONE, "never": REFUSED}
    assert (states(world), world.fleet.is_finished) == (done, True)


def test_what_a_lost_robot_had_in_hand_goes_to_another_unless_it_was_named():
    orders = (
        Order(id="any", goal=(8.5, 6.5)),
        Order(id="named", goal=(8.0, 2.0), robot="R2", release=1.0),
    )
    robots = [idle("R1", (8.5, 1.0)), idle("R2", (1.0, 6.0)), idle("R3", (1.0, 1.0))]
    scenario = replace(a_scenario(robots), orders=orders)
    world = a_world(scenario, faults=["kill:R1@2", "kill:R2@3"])
    world.run(200.0)
    assert world.fleet.is_finished
    task = world.fleet.orders.tasks["any"]
    assert (task.state, task.robot) == (ORDER_DONE, "R3")
    named = world.fleet.orders.tasks["named"]
    assert (named.state, named.reason) == (REFUSED, "R2 is lost")
    assert nobody_touches(world)


def long_hall(*robots, **fields):
    return a_scenario(robots, (12.0, 6.0), **fields)


def queue_of_two():
    robots = idle("R1", (1.0, 3.0)), idle("R2", (2.0, 3.0)), idle("R3", (1.0, 1.0))
    orders = (
        Order(id="ahead", goal=(11.0, 3.2), robot="R2"),
        Order(id="behind", goal=(10.0, 3.0), robot="R1", release=0.5),
        Order(id="beside", goal=(11.0, 1.0), robot="R3", release=1.0),
    )
    return long_hall(*robots, orders=orders)


def test_a_robot_held_by_a_lost_one_is_sent_around_it_and_nobody_else_is_stopped(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(queue_of_two(), faults=["kill:R2@6"], logs=logs)
    news = AsideNews(speed=4.0)
    world.run(25.0)
    ((who, text),) = news.news(world.mission, world.now_ns)
    assert (who, text[:16]) == ("R2", "R2 stands betwee")
    assert "`splinefleet agent R2 --at X Y HEADING --speed 4 --connect ...`" in text
    world.run(200.0)
    logs.close()
    assert news.news(world.mission, world.now_ns) == []
    assert world.fleet.is_finished
    found = states(world)
    assert (found["behind"], found["beside"], found["ahead"]) == (ORDER_DONE, ORDER_DONE, REFUSED)
    assert freezes(world) == 0
    assert_sound(world, logs)
    scene = scene_of_logs([("run.mcap", read_log(logs.paths[-1]))])
    (mark,) = [one for one in scene.marks if one.text.startswith("others go around")]
    assert (mark.text, scene.robots[mark.robot].id) == ("others go around R2", "R2")


def test_a_lost_robot_that_is_heard_again_after_others_went_around_it_drives_on(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(queue_of_two(), faults=["cut:R2@6:25"], logs=logs)
    world.run(200.0)
    logs.close()
    assert world.fleet.is_finished
    assert {states(world)[name] for name in ("ahead", "behind", "beside")} == {ORDER_DONE}
    assert any(one.text == "others go around R2" for one in world.fleet.incidents)
    assert freezes(world) == 0
    assert nobody_touches(world)
    assert prove_log(read_log(logs.paths[-1])).holds


def test_closed_places_are_left_and_driven_around_until_they_are_open_again():
    robots = idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0))
    world = a_world(long_hall(*robots), stays=True)
    say = operator(world)
    world.run(3.0)
    say(Said(9, "across", (11.0, 3.0), robot="R1"))
    world.run(2.0)
    say(Block(9, "wet", ((5.0, 0.2), (7.0, 0.2), (7.0, 4.0), (5.0, 4.0))))
    world.run(40.0)
    assert states(world)["across"] == ORDER_DONE
    wet = shapely.box(5.0, 0.2, 7.0, 4.0)
    places = {name: one.places for name, one in world.blackboxes().items()}
    assert shapely.distance(shapely.linestrings(places["R1"]), wet) >= 0.15
    assert shapely.distance(shapely.Point(places["R2"][-1]), wet) >= 0.15
    say(Said(9, "inside", (6.0, 3.0)))
    world.run(3.0)
    assert states(world)["inside"] == REFUSED
    say(Unblock(9, "wet"))
    say(Said(9, "again", (6.0, 3.0)))
    world.run(30.0)
    assert states(world)["again"] == ORDER_DONE
    assert nobody_touches(world)


def test_a_robot_whose_way_was_closed_does_an_order_without_a_name_once_it_is_open():
    """R1 might have done it too, but is lost."""
    world = a_world(
        long_hall(idle("R1", (11.0, 1.0)), idle("R2", (2.0, 3.0))), stays=True, faults=["kill:R1@1"]
    )
    say = operator(world)
    say(Block(9, "door", box(5.0, 0.0, 6.0, 6.0)))
    world.run(5.0)
    say(Said(9, "beyond", (8.0, 3.0)))
    world.run(5.0)
    assert states(world) == {"beyond": WAITING}
    say(Unblock(9, "door"))
    world.run(30.0)
    assert states(world) == {"beyond": ORDER_DONE}
    assert nobody_touches(world)


@pytest.mark.parametrize("pause", [0.5, 0.0])
def test_another_place_that_is_closed_by_the_name_of_an_earlier_one_is_driven_around(pause):
    """R1 is on a course that was planned around a place of that name, which is open again."""
    world = a_world(long_hall(idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0))), stays=True)
    say = operator(world)
    say(Block(9, "wet", box(2.0, 5.0, 3.0, 5.5)))
    world.run(3.0)
    say(Said(9, "across", (11.0, 3.0), robot="R1"))
    world.run(2.0)
    say(Unblock(9, "wet"))
    world.run(pause)
    say(Block(9, "wet", box(5.0, 2.0, 7.0, 4.0)))
    world.run(40.0)
    assert states(world)["across"] == ORDER_DONE
    said = [one.text for one in world.fleet.incidents if one.kind == "block"]
    assert said == ["wet is closed", "wet is open again", "wet is closed"]
    driven = shapely.linestrings(world.blackboxes()["R1"].places)
    assert shapely.distance(driven, shapely.box(5.0, 2.0, 7.0, 4.0)) >= 0.15


def test_robots_join_where_they_stand_get_orders_and_leave(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(
        long_hall(idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0))), stays=True, logs=logs
    )
    say = operator(world)
    world.run(3.0)
    say(Join(9, "R9", (10.0, 3.0, 1.0), 0.25, 0.8))
    say(Join(9, "R8", (1.2, 3.0, 0.0), 0.25, 0.8))
    say(Leave(9, "R2"))
    world.add("R9", 0.25, 0.8, 77)
    world.run(4.0)
    found = states(world)
    assert (found["join-R9"], found["join-R8"], found["leave-R2"]) == (
        ORDER_DONE,
        REFUSED,
        ORDER_DONE,
    )
    assert set(world.fleet.members) == {"R1", "R9"}
    say(Said(9, "crossing", (1.5, 5.0), robot="R9"))
    say(Said(9, "other", (10.0, 3.0), robot="R1"))
    world.run(40.0)
    say(Tell(9, END))
    world.run(5.0)
    logs.close()
    assert world.fleet.phase == OVER
    assert (states(world)["crossing"], states(world)["other"]) == (ORDER_DONE, ORDER_DONE)
    boxes = world.blackboxes()
    assert least_separation(boxes["R1"], boxes["R9"])[0] >= 0.45
    assert freezes(world) == 0
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log).holds


def test_an_order_that_the_nearest_robot_cannot_do_goes_to_one_that_can():
    gate = (box(5.0, 0.0, 5.4, 2.6), box(5.0, 3.4, 5.4, 6.0))
    wide, slim = idle("wide", (3.0, 3.0), radius=0.6), idle("slim", (1.0, 1.0))
    orders = (Order(id="through", goal=(9.0, 3.0)), Order(id="solid", goal=(5.2, 1.0)))
    scenario = a_scenario([wide, slim], (12.0, 6.0), gate)
    world = a_world(replace(scenario, orders=orders))
    world.run(3.0)
    assert states(world)["solid"] == REFUSED
    world.run(100.0)
    task, solid = world.fleet.orders.tasks["through"], world.fleet.orders.tasks["solid"]
    assert (task.state, task.robot) == (ORDER_DONE, "slim")
    assert solid.state == REFUSED


def test_a_course_that_its_robot_never_takes_is_withdrawn_and_holds_nobody_for_long(tmp_path):
    orders = (
        Order(id="refused", goal=(10.5, 3.2), robot="R2", release=1.0),
        Order(id="behind", goal=(9.0, 3.0), robot="R1", release=1.5),
        Order(id="any", goal=(11.0, 5.0), release=2.0),
        Order(id="taken", goal=(10.5, 4.0), robot="R2", after="behind"),
    )
    logs = RunLogs(tmp_path)
    world = a_world(replace(queue_of_two(), orders=orders), logs=logs)
    agent = world.robots["R2"].service.agent
    agent._hear_course = lambda *_: None
    world.run(15.0)
    del agent._hear_course
    world.run(200.0)
    logs.close()
    assert world.fleet.is_finished
    refused = world.fleet.orders.tasks["refused"]
    assert refused.state == REFUSED
    assert refused.reason == "R2 does not take the course that it is sent"
    assert {states(world)[name] for name in ("behind", "any", "taken")} == {ORDER_DONE}
    assert freezes(world) == 0
    assert_sound(world, logs)


@pytest.mark.parametrize("skids", [0.0, 0.15])
def test_a_robot_that_stops_by_a_fault_goes_on_and_nobody_else_is_stopped(tmp_path, skids):
    logs = RunLogs(tmp_path)
    world = a_world(queue_of_two(), logs=logs)
    world.run(7.0)
    if skids:
        world.robots["R2"].body.skid(skids)
    else:
        world.robots["R2"].service.agent.hear_driver_error(world.now_ns)
    world.run(200.0)
    logs.close()
    assert world.fleet.is_finished
    assert {states(world)[name] for name in ("ahead", "behind", "beside")} == {ORDER_DONE}
    assert any(one.text.startswith("R2 stopped") for one in world.fleet.incidents)
    assert freezes(world) == 0
    assert_sound(world, logs)


def test_a_robot_whose_wheels_stall_for_good_is_driven_around_and_the_fleet_ends(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(queue_of_two(), faults=["stall:R2@6:900"], logs=logs)
    world.run(300.0)
    logs.close()
    assert world.fleet.is_finished
    found = states(world)
    assert (found["behind"], found["beside"], found["ahead"]) == (ORDER_DONE, ORDER_DONE, REFUSED)
    assert freezes(world) == 0
    assert nobody_touches(world)
    assert prove_log(read_log(logs.paths[-1])).holds


def narrow_way():
    """Two robots one behind the other in a passage in which neither goes around the other."""
    wall = box(0.0, 0.9, 20.0, 6.0)
    robots = idle("R1", (1.0, 0.45)), idle("R2", (3.0, 0.45))
    orders = (
        Order(id="behind", goal=(23.0, 5.0), robot="R1"),
        Order(id="ahead", goal=(23.0, 2.0), robot="R2"),
    )
    return replace(a_scenario(robots, (24.0, 6.0), (wall,)), orders=orders)


def a_long_stop_in_a_narrow_way(tmp_path):
    """R2 stands long after R1 should have passed, and goes on; the world and its logs."""
    logs = RunLogs(tmp_path)
    world = a_world(narrow_way(), stays=True, logs=logs)
    world.run(7.0)
    for _ in range(3):
        world.robots["R2"].service.agent.hear_driver_error(world.now_ns)
        world.run(6.0)
    world.run(30.0)
    door = world._network.session("at the door")
    door.put(keys.admit(world.fleet.name, "R2"), encode(Admit(7)))
    world.run(60.0)
    logs.close()
    return world, logs


def test_a_robot_that_stood_for_long_goes_on_ahead_of_those_that_it_held(tmp_path):
    world, logs = a_long_stop_in_a_narrow_way(tmp_path)
    assert states(world) == {"ahead": ORDER_DONE, "behind": ORDER_DONE}
    assert freezes(world) == 0
    assert_sound(world, logs)


def test_a_course_that_begins_in_the_way_of_a_late_robot_is_not_proven(tmp_path, monkeypatch):
    """What happened when robots did not count as standing where their courses begin."""
    opened = Authority.open

    def untold(self, course, progress_ms, _begin_ms):
        opened(self, course, progress_ms, 0)

    monkeypatch.setattr(Authority, "open", untold)
    monkeypatch.setattr(Obstructions, "held_up", lambda _: {})
    world, logs = a_long_stop_in_a_narrow_way(tmp_path)
    assert not nobody_touches(world)
    assert not prove_log(read_log(logs.paths[-1])).holds


def test_a_robot_does_not_join_in_the_way_of_a_late_one_before_that_has_passed(tmp_path):
    logs = RunLogs(tmp_path)
    orders = (Order(id="through", goal=(11.0, 3.0), robot="R1"),)
    scenario = long_hall(idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0)), orders=orders)
    world = a_world(scenario, stays=True, logs=logs, faults=["stall:R1@4:14"])
    say = operator(world)
    world.run(17.0)
    say(Join(9, "R9", (7.0, 3.0, 1.0), 0.25, 0.8))
    world.run(2.0)
    assert states(world)["join-R9"] == WAITING
    world.run(30.0)
    logs.close()
    assert (states(world)["through"], states(world)["join-R9"]) == (ORDER_DONE, UNDER_WAY)
    assert_sound(world, logs)


def test_a_robot_that_failed_three_times_stands_until_it_is_admitted_and_goes_on_from_there():
    world = a_world(replace(queue_of_two()), stays=True)
    say, agent = operator(world), world.robots["R2"].service.agent
    world.run(7.0)
    for _ in range(3):
        agent.hear_driver_error(world.now_ns)
        world.run(6.0)
    x, y, _ = world.robots["R2"].body.true_pose()
    world.run(30.0)
    assert world.robots["R2"].body.true_pose()[:2] == (x, y)
    ahead = world.fleet.orders.tasks["ahead"]
    assert ahead.reason == "R2 has stopped: driver error"
    assert states(world)["behind"] == ORDER_DONE
    door = world._network.session("at the door")
    door.put(keys.admit(world.fleet.name, "R2"), encode(Admit(7)))
    world.run(40.0)
    assert states(world)["ahead"] == ORDER_DONE
    say(Tell(9, END))
    world.run(60.0)
    assert world.fleet.is_finished
    assert freezes(world) == 0
    assert nobody_touches(world)


@pytest.mark.parametrize("angle", [0.1, 0.5, 1.6, 3.1, -2.0])
def test_a_robot_that_sets_out_sideways_turns_first_and_keeps_close_to_its_path(angle):
    world = a_world(long_hall(idle("R1", (5.0, 3.0))), stays=True)
    world.run(2.0)
    goal = 5.0 + 2.0 * math.cos(angle), 3.0 + 2.0 * math.sin(angle)
    operator(world)(Said(9, "there", goal, robot="R1"))
    off = 0.0
    for _ in range(800):
        world.go_on(0.01)
        ride = world.robots["R1"].service.agent.ride
        off = max(off, ride.follower.off)
    assert states(world)["there"] == ORDER_DONE
    assert off < 0.3 * ride.track


def start_again(world, name, boot, shift=(0.0, 0.0)):
    """Start a robot's program again, which knows where the robot stands, and have it admitted."""
    x, y, heading = world.robots[name].body.true_pose()
    world.renew(name, boot, (x + shift[0], y + shift[1], heading))
    world.run(1.0)
    admit(world, name)


def admit(world, name):
    """Let an operator admit a robot."""
    door = world._network.session(f"at the door at {world.now_ns}")
    door.put(keys.admit(world.fleet.name, name), encode(Admit(7)))


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.5, 0.6)])
def test_a_robot_that_was_started_again_goes_on_from_where_it_stands(tmp_path, shift):
    logs = RunLogs(tmp_path)
    world = a_world(queue_of_two(), faults=["kill:R2@6"], logs=logs)
    world.run(9.0)
    start_again(world, "R2", 78, shift)
    world.run(200.0)
    logs.close()
    assert world.fleet.is_finished
    assert states(world) == dict.fromkeys(("ahead", "behind", "beside"), ORDER_DONE)
    assert (freezes(world), len(world.mission.documents)) == (0, 1)
    assert_sound(world, logs)


def test_a_robot_of_a_fleet_without_orders_that_was_started_again_arrives(tmp_path):
    robots = a_robot("R1", (1.0, 1.0), (11.0, 1.0)), a_robot("R2", (1.0, 5.0), (11.0, 5.0))
    logs = RunLogs(tmp_path)
    world = a_world(long_hall(*robots), faults=["restart:R2@4:1.5"], logs=logs)
    world.run(5.0)
    x, y, _ = world.robots["R2"].body.true_pose()
    world.run(3.0)
    assert not world.robots["R2"].dead
    assert world.robots["R2"].body.true_pose()[:2] == (x, y)
    admit(world, "R2")
    world.run(60.0)
    logs.close()
    assert world.fleet.is_finished
    assert world.robots["R2"].body.x == pytest.approx(11.0, abs=0.02)
    assert (freezes(world), len(world.mission.documents)) == (0, 1)
    assert_sound(world, logs)


@pytest.mark.parametrize("ahead", [3.0, 4.0])
def test_a_robot_that_comes_back_in_anothers_way_is_not_run_into(tmp_path, ahead):
    logs = RunLogs(tmp_path)
    world = a_world(queue_of_two(), faults=["kill:R2@6"], logs=logs)
    world.run(9.0)
    here, there = world.robots["R2"].body, world.robots["R3"].body
    start_again(world, "R2", 78, (there.x + ahead - here.x, there.y - here.y))
    world.run(200.0)
    logs.close()
    assert world.fleet.is_finished
    assert states(world) == dict.fromkeys(("ahead", "behind", "beside"), ORDER_DONE)
    assert freezes(world) == 0
    assert_sound(world, logs)


def test_a_robot_that_comes_back_and_does_not_know_its_place_stops_nobody(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(queue_of_two(), faults=["kill:R2@6"], logs=logs)
    world.run(9.0)
    world.renew("R2", 78, None)
    world.robots["R2"].service._place = lambda: None
    world.run(1.0)
    door = world._network.session("at the door")
    for _ in range(300):
        door.put(keys.admit(world.fleet.name, "R2"), encode(Admit(7)))
        world.run(0.2)
    said = [one.text for one in world.fleet.incidents if one.kind == "not admitted"]
    assert any("did not say where it stands" in text for text in said)
    world.run(100.0)
    logs.close()
    found = states(world)
    assert (found["ahead"], found["behind"], found["beside"]) == (REFUSED, ORDER_DONE, ORDER_DONE)
    assert freezes(world) == 0
    assert_sound(world, logs)


def test_a_program_that_is_there_before_its_robot_joins_is_taken_in_then():
    world = a_world(long_hall(idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0))), stays=True)
    say = operator(world)
    world.run(3.0)
    world.add("R9", 0.25, 0.8, 77)
    world.run(3.0)
    assert sum("is there and not in fleet" in one.text for one in world.fleet.incidents) == 1
    say(Join(9, "R9", (10.0, 3.0, 1.0), 0.25, 0.8))
    world.run(5.0)
    assert states(world)["join-R9"] == ORDER_DONE


def test_a_listener_is_told_of_both_courses_that_a_robot_may_be_driving():
    world = a_world(replace(hall(), orders=(Order(id="a", goal=(8.0, 3.0), robot="R1"),)))
    member = world.fleet.members["R1"]
    while not member.driven < member.revision:
        world.step()
    answers = world.coordinator.driver.plans_again(world.now_ns + 10**9)
    told = [decode("plan", payload) for key, payload in answers if key.endswith("/R1")]
    assert [(one.robot, one.revision) for one in told] == [("R1", 0), ("R1", 1)]
    while member.driven < member.revision:
        world.step()
    world.run(0.2)
    answers = world.coordinator.driver.plans_again(world.now_ns + 2 * 10**9)
    told = [decode("plan", payload) for key, payload in answers if key.endswith("/R1")]
    assert [one.revision for one in told] == [1]


def chain(*fields):
    """Three orders for R1 in a hall, one after the other."""
    goals = ((8.0, 3.0), (2.0, 5.0), (7.0, 6.0))
    known = dict(enumerate(fields))
    orders = [
        Order(**{"id": f"c{k}", "goal": goal, "robot": "R1", **known.get(k, {})})
        for k, goal in enumerate(goals)
    ]
    return replace(hall(), orders=tuple(orders))


def until_sent_on(world):
    """Let time pass until R1 has a course for its next order, and still drives to its goal."""
    for _ in range(600):
        world.run(0.1)
        both = world.fleet.orders.all_of("R1")
        if len(both) == 2:
            return both
    raise AssertionError("R1 was not sent on")


def test_a_robot_gets_its_next_course_before_it_arrives_and_does_not_stand_between(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(chain(), logs=logs)
    first, second = until_sent_on(world)
    assert (first.order.id, second.order.id) == ("c0", "c1")
    world.run(120.0)
    logs.close()
    assert set(states(world).values()) == {ORDER_DONE}
    assert second.arrived_ms - first.arrived_ms <= second.alone_ms + 150
    texts = [one.text for one in world.fleet.incidents]
    assert texts.count("R1 is done") == 2  # At its start, and at the last goal.
    assert_sound(world, logs)


def test_a_robot_that_dwells_gets_its_next_course_after_that():
    world = a_world(chain({"dwell": 3.0}))
    world.run(120.0)
    first, second = (world.fleet.orders.tasks[name] for name in ("c0", "c1"))
    assert second.accepted_ms >= first.arrived_ms + 3_000
    assert set(states(world).values()) == {ORDER_DONE}


def test_an_order_without_a_robot_goes_to_one_that_will_be_there_first_though_it_still_drives():
    near = {"robot": "", "goal": (8.0, 2.0), "release": 11.2}
    world = a_world(chain({}, near, {"release": 40.0}))
    first, second = until_sent_on(world)
    assert (first.order.id, second.order.id) == ("c0", "c1")
    world.run(120.0)
    assert set(states(world).values()) == {ORDER_DONE}


@pytest.mark.parametrize(("priority", "is_last"), [(0, True), (5, False)])
def test_an_order_of_a_higher_priority_waits_for_no_others_that_name_robots(priority, is_last):
    ends = [(3.0, 1.0), (1.0, 1.0)], [(3.0, 5.0), (1.0, 5.0)]
    named = [
        Order(id=f"{name}-{count}", goal=goal, robot=name)
        for count in (0, 1)
        for name, goals in zip(("R1", "R2"), ends, strict=True)
        for goal in goals[count : count + 1]
    ]
    other = Order(id="any", goal=(10.0, 3.0), priority=priority, release=1.0)
    world = a_world(
        long_hall(idle("R1", (1.0, 1.0)), idle("R2", (1.0, 5.0)), orders=(*named, other))
    )
    world.run(120.0)
    tasks = world.fleet.orders.tasks
    assert set(states(world).values()) == {ORDER_DONE}
    began = sorted(tasks, key=lambda name: tasks[name].accepted_ms or 0)
    assert (began[-1] == "any") == is_last


@pytest.mark.parametrize("which", [0, 1])
def test_an_order_is_cancelled_while_its_robot_has_courses_for_two(tmp_path, which):
    logs = RunLogs(tmp_path)
    world = a_world(chain(), logs=logs)
    until_sent_on(world)
    operator(world)(Cancel(9, f"c{which}"))
    world.run(120.0)
    logs.close()
    wanted = {f"c{k}": CANCELLED if k == which else ORDER_DONE for k in range(3)}
    assert states(world) == wanted
    assert world.fleet.is_finished
    assert_sound(world, logs)


def test_a_redirected_robot_that_was_sent_on_already_leaves_its_next_course(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(chain(), logs=logs)
    until_sent_on(world)
    operator(world)(Said(9, "now", (5.0, 1.0), robot="R1", now=True))
    world.run(150.0)
    logs.close()
    tasks = world.fleet.orders.tasks
    assert set(states(world).values()) == {ORDER_DONE}
    arrived = [tasks[name].arrived_ms for name in ("c0", "now", "c1")]
    assert arrived == sorted(arrived)
    assert_sound(world, logs)


@pytest.mark.parametrize("robot", ["R1", ""])
def test_what_a_robot_was_sent_on_for_waits_again_when_it_dies(tmp_path, robot):
    logs = RunLogs(tmp_path)
    world = a_world(chain({}, {"robot": robot}), logs=logs)
    until_sent_on(world)
    world.strike(read_faults(["kill:R1@0"], ["R1", "R2", "R3"])[0])
    world.run(200.0)
    logs.close()
    found = states(world)
    assert found["c1"] == (REFUSED if robot else ORDER_DONE)
    assert world.fleet.is_finished
    assert freezes(world) == 0
    assert_sound(world, logs)


@pytest.mark.parametrize("stalls", [False, True])
def test_a_robot_that_fails_between_two_courses_does_both_orders_later(tmp_path, stalls):
    logs = RunLogs(tmp_path)
    world = a_world(chain(), logs=logs)
    until_sent_on(world)
    if stalls:
        world.strike(read_faults(["stall:R1@0:18"], ["R1", "R2", "R3"])[0])
    else:
        world.robots["R1"].service.agent.hear_driver_error(world.now_ns)
    world.run(250.0)
    logs.close()
    assert set(states(world).values()) == {ORDER_DONE}
    assert freezes(world) == 0
    assert_sound(world, logs)


def test_a_coordinator_that_goes_on_knows_both_courses_and_both_orders(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(chain(), logs=logs)
    until_sent_on(world)
    at = (world.now_ns - world.began_ns) / 1e9
    logs.close()
    logs = RunLogs(tmp_path)
    world = a_world(chain(), logs=logs, faults=[f"coordinator-restart@{at:.2f}:3"])
    world.run(150.0)
    logs.close()
    assert states(world) == {f"c{k}": ORDER_DONE for k in range(3)}
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds
    assert nobody_touches(world)


def crossing(**fields):
    """R1 is to pass a crossing before R2, each for its order, after 20 s of driving."""
    robots = [idle("R1", (1.0, 3.0)), idle("R2", (17.0, 22.0))]
    orders = (
        Order(id="along", goal=(23.0, 3.0), robot="R1", **fields),
        Order(id="across", goal=(17.0, 1.0), robot="R2"),
    )
    return a_scenario(robots, (24.0, 24.0), orders=orders)


def test_a_robot_that_is_late_for_long_lets_another_go_first_that_waits_for_it(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(crossing(), logs=logs, faults=["stall:R1@3:14"])
    world.run(90.0)
    logs.close()
    along, across = (world.fleet.orders.tasks[name] for name in ("along", "across"))
    told = "R1 gets new times for along: others go first"
    assert [one.text for one in world.fleet.incidents].count(told) == 1
    assert across.arrived_ms < 36_000  # 40.2 s if it waits for R1.
    assert along.arrived_ms < 47_500  # 43.9 s without stopping for R2.
    assert states(world) == {"along": ORDER_DONE, "across": ORDER_DONE}
    assert freezes(world) == 0
    assert_sound(world, logs)


@pytest.mark.parametrize(("seconds", "via"), [(3.0, ()), (9.0, ()), (14.0, ((20.0, 3.0),))])
def test_a_late_robot_keeps_its_course_where_little_is_won_or_places_were_passed(seconds, via):
    world = a_world(crossing(via=via), faults=[f"stall:R1@3:{seconds}"])
    world.run(90.0)
    assert world.fleet.grants.of("R1").now.revision == 1
    assert states(world) == {"along": ORDER_DONE, "across": ORDER_DONE}
    assert nobody_touches(world)


def test_a_redirected_robot_that_is_late_is_planned_with_the_times_that_it_has():
    world = a_world(crossing(), faults=["stall:R1@3:8"])
    say = operator(world)
    world.run(14.0)
    say(Said(9, "now", (8.0, 20.0), robot="R1", now=True))
    world.run(90.0)
    now = world.fleet.orders.tasks["now"]
    assert now.state == ORDER_DONE
    assert now.arrived_ms - now.planned_arrival_ms < 1_500
    assert nobody_touches(world)
