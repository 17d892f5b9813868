"""Fleets in virtual time whose coordinator is started again on a floor that has changed."""

import pytest
import shapely
from msgspec.structs import replace

from coordinator.findings.log_proof import prove_log
from coordinator.fleet.rest_places import Standing
from coordinator.log.log_file import log_from_bytes, logs_before, read_log
from coordinator.mission.replanning_input import next_site
from coordinator.scenario.model import Order
from coordinator.service.replay import check_log, go_on
from protocol.messages import END, ORDER_DONE, UNDER_WAY, Leave, Tell
from protocol.phases import OVER
from protocol.timing import SECOND
from sim.campaigns.truth import touches
from sim.world.fault_text import Fault
from sim.world.run_logs import RunLogs
from tests.scenarios import a_robot, a_scenario, box
from tests.sim.world.test_orders_in_time import a_world, freezes, idle, operator, states

RACK = box(4.5, 1.2, 5.5, 4.0)
"""It stands on R1's way, and leaves one around it."""


def a_hall(**fields):
    robots = [
        idle("R1", (1.0, 3.0)),
        idle("R2", (1.0, 6.0)),
        a_robot("R3", (8.0, 1.0), (8.0, 6.0)),
    ]
    orders = (
        Order(id="a", goal=(8.5, 3.0), robot="R1"),
        Order(id="b", goal=(1.0, 1.0), after="a", robot="R1"),
        Order(id="c", goal=(3.0, 6.0), robot="R2", release=2.0),
    )
    return a_scenario(robots, orders=orders, **fields)


def on_another_floor(scenario, logs, obstacles, *, seconds=200.0):
    """A world in which the floor has other obstacles after a restart under way, and that time."""
    world = a_world(scenario, logs=logs)
    while states(world).get("a") != UNDER_WAY:
        world.step()
    world.go_on(2.0)
    world.coordinator.die()
    world.go_on(3.0)
    floor = replace(scenario.workspace, obstacles=obstacles)
    world.coordinator.come_back(replace(scenario, workspace=floor))
    since_ns = world.now_ns
    world.run(seconds)
    logs.close()
    return world, since_ns


def test_a_fleet_goes_around_what_is_new_on_its_floor(tmp_path):
    logs = RunLogs(tmp_path)
    world, since_ns = on_another_floor(a_hall(), logs, (RACK,))
    assert states(world) == dict.fromkeys("abc", ORDER_DONE)
    assert freezes(world) == 1
    assert world.fleet.epoch == 2
    assert touches(world.mission.documents[2], world.blackboxes(), ()) == []
    rack, after_s = shapely.Polygon(RACK), (since_ns - world.began_ns) / 1e9
    for robot_box in world.blackboxes().values():
        places = robot_box.places[robot_box.t > after_s]
        assert shapely.distance(shapely.points(places), rack).min() > 0.2
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds


def test_a_robot_that_was_lost_on_one_floor_and_left_is_not_planned_for_on_the_next(tmp_path):
    scenario, logs = a_hall(), RunLogs(tmp_path)
    world = a_world(scenario, logs=logs, stays=True)
    say = operator(world)
    while states(world).get("a") != UNDER_WAY:
        world.step()
    world.go_on(2.0)
    world.strike(Fault("kill", "R1", 0.0, 0.0))
    for obstacles in ((RACK,), ()):
        world.coordinator.die()
        world.go_on(2.0)
        floor = replace(scenario.workspace, obstacles=obstacles)
        world.coordinator.come_back(replace(scenario, workspace=floor))
        world.run(20.0)
        say(Leave(9, "R1"))
        world.run(10.0)
    say(Tell(9, END))
    world.run(60.0)
    logs.close()
    assert (world.fleet.phase, world.fleet.epoch, states(world)["c"]) == (OVER, 3, ORDER_DONE)
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds


def test_a_robot_that_was_just_sent_off_is_planned_for_from_where_it_stands(tmp_path):
    """It has not begun its course: it is at the goal of its old one, not of the new one."""
    logs = RunLogs(tmp_path)
    world = a_world(a_hall(), logs=logs)
    while states(world).get("a") != UNDER_WAY:
        world.step()
    mission = go_on(log_from_bytes(logs.cut(), "run.mcap"), 77, world.now_ns + SECOND)
    member = mission.fleet.members["R1"]
    assert (member.driven, member.revision) == (0, 1)
    assert not member.is_at_rest()  # It may have begun since.
    stands = Standing(robot="R1", state="rests", epoch=1, s=1e9, revision=0)
    site = next_site(mission.site, mission.rides, [stands])
    (robot,) = [one for one in site.scenario.robots if one.id == "R1"]
    assert robot.start[:2] == pytest.approx((1.0, 3.0), abs=2e-3)
    assert robot.goal == (8.5, 3.0)


def test_what_is_gone_from_the_floor_is_in_nobodys_way(tmp_path):
    logs = RunLogs(tmp_path)
    world, _ = on_another_floor(a_hall(obstacles=[RACK]), logs, ())
    assert states(world) == dict.fromkeys("abc", ORDER_DONE)
    assert check_log(read_log(logs.paths[-1])).difference == ""


def test_a_robot_without_a_way_any_more_stays_and_the_others_go_on(tmp_path):
    logs = RunLogs(tmp_path)
    wall = box(6.5, 0.0, 7.0, 5.0)
    world, _ = on_another_floor(a_hall(), logs, (wall, box(6.5, 5.0, 10.0, 5.3)))
    told = [one.text for one in world.fleet.incidents if one.kind == "stays"]
    assert any(text.startswith("R1 stays where it is: ") for text in told)
    assert states(world)["c"] == ORDER_DONE
    assert states(world)["a"] != ORDER_DONE
    assert check_log(read_log(logs.paths[-1])).difference == ""


def test_a_robot_at_its_goal_that_is_heard_no_more_holds_up_no_new_epoch(tmp_path):
    logs, scenario = RunLogs(tmp_path), a_hall()
    world = a_world(scenario, logs=logs, faults=["kill:R3@14"])
    world.go_on(15.0)
    assert world.fleet.members["R3"].finished
    world.coordinator.die()
    world.go_on(3.0)
    floor = replace(scenario.workspace, obstacles=(RACK,))
    world.coordinator.come_back(replace(scenario, workspace=floor))
    world.run(200.0)
    logs.close()
    assert states(world) == dict.fromkeys("abc", ORDER_DONE)
    assert world.fleet.epoch <= 3
    assert check_log(read_log(logs.paths[-1])).difference == ""
