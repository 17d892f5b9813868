"""Fleets in virtual time that have goals and no orders, judged by their true places.

Nobody ever freezes: who is in the way of others is gone around, by single courses.
"""

import numpy as np
import pytest
import shapely
from msgspec.structs import replace

from coordinator.findings.log_proof import prove_log
from coordinator.log.log_file import logs_before, read_log
from coordinator.scenario_files.scenario_reader import parse_scenario
from coordinator.service.replay import check_log
from protocol.messages import GO_ON, HALT, ORDER_DONE, Block, Tell
from protocol.phases import OVER, STOP
from sim.campaigns.campaign import Wish, run_seed
from sim.campaigns.truth import arrived, touches
from sim.world.fault_script import read_faults
from sim.world.run_logs import RunLogs
from tests.scenarios import a_robot, a_scenario, box
from tests.sim.world.test_orders_in_time import (
    a_world,
    admit,
    assert_sound,
    freezes,
    long_hall,
    operator,
    start_again,
    states,
)
from tests.sim.world.test_virtual_fleet import ROBOTS, SCENARIO

GOOD_LINK = Wish(loss=0.0, delay=0.005)


def queue():
    """R1 follows R2 along a hall, and R3 crosses it far from both."""
    return long_hall(
        a_robot("R1", (1.0, 3.0), (11.0, 3.0)),
        a_robot("R2", (3.0, 3.0), (10.0, 3.6)),
        a_robot("R3", (1.0, 5.4), (11.0, 5.4)),
    )


def those_there(world):
    return arrived(world, world.mission.documents[1], world.blackboxes())


def test_who_is_held_by_a_dead_robot_is_sent_around_it_and_the_others_never_slow_down(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(queue(), faults=["kill:R2@5"], logs=logs)
    world.run(200.0)
    logs.close()
    assert (world.fleet.phase, world.fleet.epoch, freezes(world)) == (OVER, 1, 0)
    assert those_there(world) == {"R1", "R3"}
    assert states(world) == {"way-1": ORDER_DONE}
    assert world.fleet.orders.tasks["way-1"].robot == "R1"
    box_3, finish = world.blackboxes()["R3"], world.mission.documents[1].robot("R3").finish_time
    assert np.hypot(*(box_3.at(np.array([finish + 0.3]))[0] - (11.0, 5.4))) < 0.03
    assert_sound(world, logs)


def test_a_fleet_ends_soon_after_the_last_one_that_can_has_arrived():
    world = a_world(queue(), faults=["kill:R2@5"])
    world.run(200.0)
    boxes = world.blackboxes()
    last = max(one.t[np.flatnonzero(np.diff(one.places[:, 0]))[-1]] for one in boxes.values())
    over = next(one.now_ns for one in world.fleet.incidents if one.text == "OVER")
    assert 0.0 < (over - world.began_ns) / 1e9 - last < 15.0
    assert not world.fleet.members.has_arrived


@pytest.mark.parametrize("time", [3.0, 5.0, 6.5])
def test_all_that_a_robot_may_still_drive_when_it_is_cut_off_is_solid_for_others(tmp_path, time):
    logs = RunLogs(tmp_path)
    world = a_world(queue(), faults=[f"cut:R2@{time}:22"], logs=logs)
    while not world.fleet.grants.given_up:
        world.step()
    world.go_on(0.3)
    body, solid = world.robots["R2"].body, world.mission.dispatcher.obstructions.around["R2"]
    (span,) = world.fleet.spans("R2")
    ride = world.mission.rides["R2", 1, 0]
    ends = [ride.timeline.s_at(ms / 1000.0) for ms in (span.since_ms, span.until_ms)]
    assert ends[1] - ends[0] > 0.3
    stretch = shapely.LineString(ride.curve.at_arc(np.linspace(*ends, 50)))
    assert shapely.Polygon(solid).covers(stretch.buffer(0.2))
    assert shapely.Polygon(solid).covers(shapely.Point(body.x, body.y))
    world.run(250.0)
    logs.close()
    assert (world.fleet.phase, freezes(world)) == (OVER, 0)
    assert those_there(world) == set(ROBOTS)  # R2 is heard again, and gets a course from there.
    assert_sound(world, logs)


@pytest.mark.parametrize("restart", [None, 6.5, 8.5, 10.5])
def test_a_robot_comes_back_whenever_the_coordinator_is_started_again(tmp_path, restart):
    """It is killed at 4 s, started again at 8 s, and admitted at 9 s."""
    faults = ["kill:R2@4"] + [f"coordinator-restart@{restart}:2"] * (restart is not None)
    robots = a_robot("R1", (1.0, 1.0), (11.0, 1.0)), a_robot("R2", (1.0, 5.0), (11.0, 5.0))
    logs = RunLogs(tmp_path)
    world = a_world(long_hall(*robots), faults=faults, logs=logs)
    world.run(8.0)
    start_again(world, "R2", 78)
    for _ in range(10):  # An operator who hears nothing asks again.
        world.run(1.0)
        if "R2" not in those_back(world):
            admit(world, "R2")
    world.run(150.0)
    logs.close()
    assert (world.fleet.phase, world.fleet.epoch, freezes(world)) == (OVER, 1, 0)
    assert world.robots["R2"].body.x == pytest.approx(11.0, abs=0.02)
    assert touches(world.mission.documents[1], world.blackboxes(), ()) == []
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds


def test_a_robot_that_is_admitted_while_the_fleet_is_stopped_lets_it_stay_stopped(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(queue(), faults=["kill:R2@4"], logs=logs)
    world.run(6.0)
    say = operator(world)
    say(Tell(9, HALT))
    world.run(1.0)
    start_again(world, "R2", 78)
    world.run(10.0)
    assert (world.fleet.phase, those_back(world)) == (STOP, {"R2"})
    say(Tell(9, GO_ON))
    world.run(150.0)
    logs.close()
    assert (world.fleet.phase, world.fleet.epoch, freezes(world)) == (OVER, 1, 0)
    assert world.robots["R2"].body.x == pytest.approx(10.0, abs=0.02)
    assert those_there(world) == set(ROBOTS)
    assert_sound(world, logs)


def those_back(world):
    return {one.robot for one in world.fleet.incidents if one.kind == "admitted"}


def passes(world, robot, place):
    """How often a robot truly came within 3 cm of a place, and left again."""
    near = np.hypot(*(world.blackboxes()[robot].places - place).T) < 0.03
    return int(np.count_nonzero(np.diff(near.astype(int)) == 1))


@pytest.mark.parametrize("dead", [["kill:R2@9"], ["kill:R2@9", "kill:R3@9"]])
def test_places_to_pass_are_passed_once_each_by_who_is_sent_around_others_once_or_twice(dead):
    via = ((3.0, 2.0), (8.5, 4.0), (13.5, 2.0))
    robots = (
        replace(a_robot("R1", (1.0, 3.0), (16.5, 3.0)), via=via),
        a_robot("R2", (6.2, 1.0), (5.8, 5.2)),
        a_robot("R3", (11.2, 5.2), (10.8, 1.0)),
    )
    world = a_world(a_scenario(robots, (18.0, 6.0)), faults=dead)
    world.run(300.0)
    assert (world.fleet.phase, freezes(world)) == (OVER, 0)
    assert "R1" in those_there(world)
    assert [passes(world, "R1", place) for place in via] == [1, 1, 1]


def test_a_closed_place_is_driven_around_without_an_order():
    world = a_world(long_hall(a_robot("R1", (1.0, 3.0), (11.0, 3.0))))
    say = operator(world)
    world.run(3.0)
    say(Block(9, "spill", ((6.0, 2.0), (7.0, 2.0), (7.0, 4.0), (6.0, 4.0))))
    world.run(100.0)
    assert (world.fleet.phase, freezes(world)) == (OVER, 0)
    assert those_there(world) == {"R1"}
    places = shapely.points(world.blackboxes()["R1"].places)
    assert shapely.distance(places, shapely.Polygon(box(6.0, 2.0, 7.0, 4.0))).min() > 0.2


@pytest.mark.parametrize("restart", [None, 6, 10])
def test_two_that_wait_for_a_dead_robot_and_for_each_other_both_arrive(restart):
    """R2 is behind R3 on its new course, and R3 has no way before R2 is out of it."""
    scenario = parse_scenario(SCENARIO, "three.toml")
    faults = ["kill:R1@3"] + [f"coordinator-restart@{restart}:2"] * (restart is not None)
    outcome = run_seed(scenario, 8, GOOD_LINK, read_faults(faults, ROBOTS))
    assert outcome.violations == ()
    assert (outcome.arrived, outcome.expected, outcome.epochs) == (2, 2, 1)
