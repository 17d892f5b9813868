"""Robots that others go around and that come back late: they drive no farther, and hold others."""

import pytest

from coordinator.findings.log_proof import prove_log
from coordinator.fleet.grants import Grants
from coordinator.log.log_file import read_log
from coordinator.scenario.model import Order
from coordinator.schedule.authority import EVER
from protocol.messages import Block, Unblock
from protocol.messages import Order as Said
from sim.world.run_logs import RunLogs
from tests.scenarios import a_scenario, box
from tests.sim.world.test_orders_in_time import (
    a_world,
    assert_sound,
    idle,
    nobody_touches,
    operator,
)

HALL = (14.0, 8.0)


@pytest.mark.parametrize("ahead", [True, False])
def test_a_robot_that_others_go_around_drives_no_farther_whatever_is_closed_and_opened(
    tmp_path, ahead
):
    """R1 is cut off for 40 s; R3 goes to a place on its course.  A place is closed meanwhile:
    ahead on that course, or far away and opened again.
    """
    robots = [idle("R1", (1.0, 1.0)), idle("R3", (9.0, 6.0))]
    orders = (
        Order(id="first", goal=(12.0, 1.0), robot="R1"),
        Order(id="there", goal=(9.0, 1.0), robot="R3", release=18.0),
    )
    logs = RunLogs(tmp_path)
    scenario = a_scenario(robots, size=HALL, orders=orders)
    world = a_world(scenario, faults=["cut:R1@4:40"], planning_ns=150_000_000, logs=logs)
    say = operator(world)
    world.run(26.0)
    say(Block(9, "wet", box(10.5, 0.5, 11.0, 1.5) if ahead else box(13.0, 7.0, 13.5, 7.5)))
    world.run(2.0)
    if not ahead:
        say(Unblock(9, "wet"))
    world.run(60.0)
    logs.close()
    assert any("others go around R1" in one.text for one in world.fleet.incidents)
    assert_sound(world, logs)


def redirected_and_cut_off(tmp_path):
    """R1 begins a second course in motion, is cut off before it says so, and stalls.

    Others are sent around it; R3 is to go where it stands.
    """
    slow = {"max_speed": 0.15, "max_accel": 0.3, "max_lateral_accel": 0.3}
    robots = [idle("R1", (1.0, 1.0)), idle("R3", (4.1, 6.8), **slow)]
    orders = (
        Order(id="first", goal=(12.0, 1.0), robot="R1"),
        Order(id="slow", goal=(4.1, 1.0), robot="R3", release=1.0),
    )
    logs = RunLogs(tmp_path)
    faults = ["cut:R1@4.93:16", "stall:R1@4.93:60"]
    scenario = a_scenario(robots, size=HALL, orders=orders)
    world = a_world(scenario, faults=faults, planning_ns=150_000_000, logs=logs)
    world.run(5.0)
    operator(world)(Said(9, "second", (12.0, 5.0), robot="R1", now=True))
    world.run(70.0)
    logs.close()
    assert any("others go around R1" in one.text for one in world.fleet.incidents)
    return world, logs


def test_a_robot_that_began_a_withdrawn_course_in_motion_still_holds_those_behind_it(tmp_path):
    world, logs = redirected_and_cut_off(tmp_path)
    assert_sound(world, logs)


def test_the_log_shows_if_a_withdrawn_course_counted_as_passed(tmp_path, monkeypatch):
    monkeypatch.setattr(
        Grants, "_take_place", lambda grants, _, old: grants._rule.reach(old.slot, EVER)
    )
    world, logs = redirected_and_cut_off(tmp_path)
    assert not nobody_touches(world)
    assert not prove_log(read_log(logs.paths[-1])).holds
