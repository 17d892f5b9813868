"""Robots under way that are sent elsewhere, in virtual time: they change courses while driving."""

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.findings.log_proof import prove_log
from coordinator.log.log_file import logs_before, read_log
from coordinator.mission.searches import Searches
from coordinator.scenario.model import Order
from coordinator.schedule.authority import EVER, Authority
from coordinator.service.replay import check_log
from protocol.messages import CANCELLED, GO_ON, HALT, ORDER_DONE, Cancel, Tell
from protocol.messages import Order as Said
from protocol.timing import SECOND
from sim.world.fault_text import Fault
from sim.world.run_logs import RunLogs
from tests.scenarios import a_robot, a_scenario
from tests.sim.world.test_orders_in_time import (
    a_world,
    assert_sound,
    freezes,
    idle,
    nobody_touches,
    operator,
    states,
)

REDIRECTED = 5.0
"""When R1, which drives along y = 1, is sent elsewhere [s]."""


def hall(**fields):
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0)), a_robot("R3", (8.0, 7.0), (2.0, 7.0))]
    orders = (Order(id="first", goal=(8.0, 1.0), robot="R1"),)
    return a_scenario(robots, orders=orders, **fields)


def redirect(world, goal, **fields):
    """Send R1 elsewhere; return what sends further messages."""
    say = operator(world)
    say(Said(9, "second", goal, robot="R1", now=True, **fields))
    return say


def speeds(world, begin, end):
    """R1's true speeds [m/s] between two times [s since GO]."""
    box = world.blackboxes()["R1"]
    times = np.arange(begin, end, 0.1)
    return np.hypot(*np.diff(box.at(times), axis=0).T) / 0.1


@pytest.mark.parametrize("goal", [(8.0, 4.0), (4.0, 6.0), (1.0, 4.0)])
@pytest.mark.parametrize("faults", [[], ["stall:R1@3:0.6"]])
def test_a_redirected_robot_never_stands_between_its_courses(goal, faults, tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(hall(), logs=logs, faults=faults)
    world.run(REDIRECTED)
    redirect(world, goal)
    world.run(60.0)
    logs.close()
    tasks = world.fleet.orders.tasks
    assert set(states(world).values()) == {ORDER_DONE}
    assert world.mission.dispatcher.searches.serial == 3
    assert speeds(world, REDIRECTED, 0.001 * tasks["second"].arrived_ms - 1.5).min() > 0.15
    assert_sound(world, logs)


def test_a_robot_with_two_reasons_to_leave_its_course_is_asked_for_one_at_a_time(monkeypatch):
    asked, ask = [], Searches.ask
    monkeypatch.setattr(
        Searches, "ask", lambda *args, **ways: asked.append(args[2:5:2]) or ask(*args, **ways)
    )
    world = a_world(hall())
    world.run(REDIRECTED)
    world.fleet.orders.go_around("R1", (1, (8.0, 1.0), ()), "nothing", 5_000)
    redirect(world, (4.0, 6.0))
    world.run(90.0)
    assert len(set(asked)) == len(asked) > 2
    assert set(states(world).values()) == {ORDER_DONE}


def test_a_redirected_robot_does_not_even_slow_down_where_the_way_bends_little():
    world = a_world(hall())
    world.run(REDIRECTED)
    redirect(world, (8.0, 3.0))
    world.run(60.0)
    assert speeds(world, REDIRECTED, REDIRECTED + 3.0).min() > 0.7


def test_a_cancelled_robot_and_one_sent_to_a_place_that_it_has_passed_stop_first(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_world(hall(), logs=logs)
    world.run(REDIRECTED)
    say = redirect(world, (4.5, 1.0))
    world.run(3.0)
    say(Cancel(9, "second"))
    world.run(60.0)
    logs.close()
    assert states(world)["second"] == CANCELLED
    assert states(world)["first"] == ORDER_DONE
    assert_sound(world, logs)


@pytest.mark.parametrize("seconds", [0.3, 4.0, 9.0])
def test_a_robot_that_hears_of_its_new_course_late_or_never_stops_where_they_part(
    seconds, tmp_path
):
    logs = RunLogs(tmp_path)
    world = a_world(hall(), logs=logs)
    world.run(REDIRECTED)
    agent = world.robots["R1"].service.agent
    agent._hear_course = lambda *_: None
    redirect(world, (8.0, 4.0))
    world.run(seconds)
    old = world.fleet.grants.of("R1").now.course.driven
    place = world.robots["R1"].body.pose()[:2]
    del agent._hear_course
    if seconds > 3.0:
        told_ms = world.fleet.grants.ends.told_ms("R1")
        (there,) = old.curve.at_arc([old.timeline.s_at(0.001 * told_ms)])
        assert np.hypot(*(there - place)) < 0.02
    world.run(60.0)
    logs.close()
    assert states(world)["first"] == ORDER_DONE
    assert (states(world)["second"] == ORDER_DONE) == (seconds < 5.0)
    assert_sound(world, logs)


MOMENTS = {
    "looked for": lambda world: world.mission.dispatcher.searches.has("R1"),
    "told": lambda world: world.robots["R1"].service.agent.holds == 2,
    "confirmed": lambda world: world.fleet.grants.of("R1").now.revision == 2,
    "leads off": lambda world: place_of(world) > 1.05,
}
"""When a fault strikes: where the course leads off, too, which is at y = 1 until then."""
FAULTS = {
    "dies": "kill:R1@{}",
    "stalls": "stall:R1@{}:4",
    "is cut off": "cut:R1@{}:14",
    "loses its coordinator": "coordinator-restart@{}:2",
}


def place_of(world):
    return world.robots["R1"].body.pose()[1]


def a_change(faults=(), logs=None):
    """R1 is sent elsewhere, and R3 comes to pass where it drives."""
    robots = (*hall().robots[:2], idle("R3", (9.0, 1.0)))
    by = Order(id="by", goal=(2.0, 1.0), robot="R3", release=7.0)
    scenario = replace(hall(), robots=robots, orders=(*hall().orders, by))
    world = a_world(scenario, logs=logs, faults=faults, planning_ns=150_000_000)
    world.run(REDIRECTED)
    return world, redirect(world, (8.0, 4.0))


@pytest.fixture(scope="module")
def moments():
    """When [s since GO] each of MOMENTS comes without a fault."""
    world, _ = a_change()
    found, now = {}, REDIRECTED
    while len(found) < len(MOMENTS):
        world.run(0.05)
        now += 0.05
        for name, has_come in MOMENTS.items():
            if name not in found and has_come(world):
                found[name] = now
    assert list(found) == list(MOMENTS)
    return found


@pytest.mark.parametrize("moment", MOMENTS)
@pytest.mark.parametrize("fault", [*FAULTS, "has a driver error", "is stopped"])
def test_a_change_in_motion_may_be_interrupted_at_any_moment(moments, moment, fault, tmp_path):
    at = moments[moment]
    logs = RunLogs(tmp_path)
    faults = [FAULTS[fault].format(round(at, 3))] if fault in FAULTS else []
    world, say = a_change(faults, logs)
    world.run(at - REDIRECTED)
    if fault == "has a driver error":
        world.robots["R1"].service.agent.hear_driver_error(world.now_ns)
    if fault == "is stopped":
        say(Tell(9, HALT))
        world.run(3.0)
        say(Tell(9, GO_ON))
    world.run(120.0)
    logs.close()
    assert world.fleet.is_finished
    assert states(world)["by"] == ORDER_DONE
    assert (states(world)["second"] == ORDER_DONE) == (fault != "dies")
    assert freezes(world) == 0
    assert nobody_touches(world)
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds


def test_authority_on_a_course_that_nobody_reported_beyond_where_it_parts_is_found(tmp_path):
    """What a coordinator would send that grants on the new course at once."""
    logs = RunLogs(tmp_path)
    world = a_world(hall(), logs=logs)
    rule = world.fleet.grants._rule
    rule.follow = lambda course, *_: Authority.follow(rule, course, course, EVER)
    world.run(REDIRECTED)
    world.robots["R1"].service.agent._hear_course = lambda *_: None
    redirect(world, (8.0, 4.0))
    world.run(4.0)
    logs.close()
    proof = prove_log(read_log(logs.paths[-1]))
    assert any(
        "R1 drive on course 2, which it has not said that it drives, beyond" in failure
        for epoch in proof.epochs
        for failure in epoch.failures
    )


def a_late_change(speed, accel, wanted, margin):
    """R1 stalls as it takes a course for which it turns first, and gets one that begins in motion.

    Returns the world in which R1 has just changed to that.
    """
    quick = {"max_speed": speed, "max_accel": accel, "max_lateral_accel": accel}
    robots = (idle("R1", (5.0, 4.0), **quick), idle("R2", (9.0, 7.0)))
    orders = (Order(id="first", goal=(1.0, 4.0), robot="R1", release=2.0),)
    scenario = a_scenario(robots, size=(10.0, 8.0), orders=orders, margin=margin)
    world = a_world(scenario, planning_ns=60_000_000, stays=True)
    agent = world.robots["R1"].service.agent
    while agent.revision < 1:
        world.step()
    world.strike(Fault("stall", "R1", 0, 4.0))
    world.run(wanted)
    operator(world)(Said(9, "second", (1.0, 5.5), robot="R1", now=True))
    until = world.now_ns + 20 * SECOND
    while agent.revision < 2 and world.now_ns < until:
        world.step()
    return world


@pytest.mark.parametrize(
    ("speed", "accel", "wanted", "margin"),
    [(3.0, 3.0, 2.1, 0.02), (3.0, 3.0, 2.2, 0.02), (5.0, 5.0, 2.2, 0.05), (0.8, 0.8, 1.6, 0.05)],
)
def test_a_late_robot_changes_courses_only_where_it_is_on_both(speed, accel, wanted, margin):
    """At 3 m/s it drives 60 mm in a tick, and may be 9 mm from where its reports say that it is.

    The last robot has yet to turn on the spot when it may change.
    """
    world = a_late_change(speed, accel, wanted, margin)
    ride = world.robots["R1"].service.agent.ride
    newer = next(one.course for one in world.fleet.grants.of("R1") if one.revision == 2)
    arcs = np.arange(0.0, newer.driven.curve.length, 1e-3)
    begun = arcs >= newer.driven.timeline.s_at(ride.begin) - 1e-6
    until = world.now_ns + 3 * SECOND
    while world.now_ns < until:
        place = world.robots["R1"].body.true_pose()[:2]
        apart = np.hypot(*(newer.driven.curve.at_arc(arcs[begun]) - place).T)
        assert apart.min() <= ride.track + 2e-3
        world.step()
    world.run(20.0)
    assert not any("off its path" in one.text for one in world.fleet.incidents)
    assert set(states(world).values()) == {ORDER_DONE}
