"""Robots that others go around and that come back late: they drive no farther, and hold others."""

import math

import pytest

from coordinator.findings.log_proof import prove_log
from coordinator.fleet.grants import Grants
from coordinator.log.log_file import logs_before, read_log
from coordinator.mission.obstructions import Aside, Obstructions
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Order
from coordinator.schedule.authority import EVER
from coordinator.service.replay import check_log
from protocol.messages import (
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    Block,
    Cancel,
    Join,
    Leave,
    Unblock,
)
from protocol.messages import Order as Said
from protocol.phases import DONE
from protocol.timing import SECOND
from sim.judging.judge import least_separation
from sim.world.fault_script import read_faults
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import NO_FLAWS, USUAL_FLAWS, World
from tests.scenarios import a_robot, a_scenario, box
from tests.sim.world.test_orders_in_time import (
    a_world,
    admit,
    assert_sound,
    idle,
    nobody_touches,
    operator,
    start_again,
    states,
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
        Grants, "_take_place", lambda grants, _, old, _own: grants._rule.reach(old.slot, EVER)
    )
    world, logs = redirected_and_cut_off(tmp_path)
    assert not nobody_touches(world)
    assert not prove_log(read_log(logs.paths[-1])).holds


def a_fleet(tmp_path, robots, orders=(), faults=(), **options):
    """Return a fleet in a hall, and its logs."""
    logs = RunLogs(tmp_path)
    scenario = a_scenario(robots, size=HALL, orders=orders)
    options = {"planning_ns": 150_000_000, "stays": True, **options}
    return a_world(scenario, faults=faults, logs=logs, **options), logs


def crossed(tmp_path):
    """R1 rests at a goal, is sent on, and is cut off before it says so; R2 crosses its way."""
    orders = (
        Order(id="far", goal=(11.0, 3.0), robot="R1", release=2.7),
        Order(id="cross", goal=(6.0, 1.0), robot="R2", release=4.0),
        Order(id="again", goal=(6.0, 3.0), robot="R2", release=6.0),
    )
    robots = [idle("R1", (1.0, 3.0)), idle("R2", (6.0, 5.2))]
    world, logs = a_fleet(tmp_path, robots, orders, ["cut:R1@3.0:20"])
    world.run(90.0)
    logs.close()
    return world, logs


def test_a_robot_that_began_a_withdrawn_course_at_a_goal_is_granted_nothing(tmp_path):
    world, logs = crossed(tmp_path)
    assert set(states(world).values()) == {ORDER_DONE}
    assert_sound(world, logs)


def test_the_log_shows_if_such_a_robot_is_granted_the_headroom(tmp_path, monkeypatch):
    take_place = Grants._take_place

    def at_goal(grants, begun, old, own):
        take_place(grants, begun, old, own)
        grants._done[begun.slot] = True

    monkeypatch.setattr(Grants, "_take_place", at_goal)
    world, logs = crossed(tmp_path)
    assert not nobody_touches(world)
    assert not prove_log(read_log(logs.paths[-1])).holds


@pytest.mark.parametrize("later", [0.2, 0.75])
def test_where_a_robot_came_back_stays_closed_when_it_is_lost_again(tmp_path, later):
    """R1 is started again 3 m beside its course, admitted, and dies once more; R2 is sent there."""
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0))]
    orders = (Order(id="far", goal=(12.0, 1.0), robot="R1", release=1.0),)
    world, logs = a_fleet(tmp_path, robots, orders, ["kill:R1@6"], planning_ns=300_000_000)
    say = operator(world)
    world.run(9.0)
    start_again(world, "R1", 78, (0.5, 3.0))
    world.run(later)
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    died = (world.now_ns - world.began_ns) / SECOND
    world.run(5.0)
    x, y, _ = world.robots["R1"].body.true_pose()
    say(Said(9, "through", (x + 4.0, y), robot="R2", via=((x - 1.5, y),)))
    world.run(60.0)
    logs.close()
    boxes = [box.between(died, math.inf, 0.0) for box in world.blackboxes().values()]
    assert least_separation(*boxes)[0] > 0.4
    log = read_log(logs.paths[-1])
    assert (check_log(log).difference, prove_log(log).holds) == ("", True)


@pytest.mark.parametrize("later", [0.05, 0.2])
def test_where_a_robot_comes_back_is_closed_although_it_came_back_elsewhere_before(tmp_path, later):
    """R2 is on a course planned around where R1 came back; R1 comes back upon that, and dies."""
    slow = {"max_speed": 0.3, "max_accel": 0.3, "max_lateral_accel": 0.3}
    robots = [idle("R1", (1.0, 6.5)), idle("R2", (1.0, 1.0), **slow)]
    world, logs = a_fleet(tmp_path, robots, planning_ns=300_000_000)

    def comes_back(boot, x, y):
        world.strike(Fault("kill", "R1", 0.0, 0.0))
        world.run(1.5)
        world.renew("R1", boot, (x, y, 0.0))
        world.run(1.0)
        admit(world, "R1")
        while world.fleet.members["R1"].boot != boot:
            world.step()

    world.run(2.0)
    comes_back(78, 4.0, 4.0)
    operator(world)(Said(9, "far", (13.0, 1.0), robot="R2"))
    world.run(7.0)
    comes_back(79, 8.0, 1.0)
    back = (world.now_ns - world.began_ns) / SECOND
    world.run(later)
    world.strike(Fault("kill", "R1", 0.0, 0.0))
    world.run(60.0)
    logs.close()
    assert states(world)["far"] == ORDER_DONE
    boxes = [box.between(back, math.inf, 0.0) for box in world.blackboxes().values()]
    assert least_separation(*boxes)[0] > 0.4
    log = read_log(logs.paths[-1])
    assert (check_log(log).difference, prove_log(log).holds) == ("", True)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (0.0, 4.0)])
def test_a_robot_killed_as_it_was_sent_on_is_admitted_where_it_stands(tmp_path, shift):
    """Its next program must not take the course that was meant for the one before it."""
    world, logs = a_fleet(tmp_path, [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 7.0))])
    say = operator(world)
    world.run(4.0)
    say(Said(9, "a", (8.0, 1.0), robot="R1"))
    while world.fleet.grants.of("R1").next is None:
        world.step()
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.run(0.5)
    start_again(world, "R1", 78, shift)
    world.run(60.0)
    logs.close()
    assert states(world)["a"] == ORDER_DONE
    log = read_log(logs.paths[-1])
    assert (check_log(log).difference, prove_log(log).holds) == ("", True)


def test_a_robot_whose_course_was_withdrawn_gets_another_though_nobody_moves(tmp_path):
    orders = (Order(id="far", goal=(11.0, 1.0), robot="R1", release=1.0),)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 5.0))]
    world, logs = a_fleet(tmp_path, robots, orders, ["driver-error:R1@4"])
    world.run(4.4)
    while (coming := world.fleet.grants.of("R1").next) is None or coming.is_withdrawn:
        world.step()
    world.run(0.12)
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.run(0.5)
    start_again(world, "R1", 79)
    world.run(60.0)
    logs.close()
    assert states(world)["far"] == ORDER_DONE
    assert_sound(world, logs)


def test_one_stopped_on_the_next_course_of_a_lost_robot_gets_away(tmp_path):
    """R1 was given up, got a course across that of R2, and is lost before it begins it."""
    orders = (
        Order(id="far", goal=(11.0, 4.0), robot="R1", release=1.0),
        Order(id="down", goal=(7.0, 1.0), robot="R2", release=3.0),
    )
    robots = [idle("R1", (1.0, 4.0)), idle("R2", (7.0, 7.0))]
    faults = ["driver-error:R1@4", "driver-error:R2@9"]
    world, logs = a_fleet(tmp_path, robots, orders, faults)
    world.run(4.4)
    while (coming := world.fleet.grants.of("R1").next) is None or coming.is_withdrawn:
        world.step()
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.run(7.0)
    assert world.fleet.orders.tasks["down"].reason == "waits for R1"
    world.run(53.0)
    logs.close()
    assert states(world)["down"] == ORDER_DONE
    assert_sound(world, logs)


def test_a_robot_that_is_let_in_need_not_begin_the_course_of_a_cancelled_order(tmp_path):
    """R1 was given up, got another course, and died before it began that; its order is over."""
    orders = (Order(id="far", goal=(11.0, 1.0), robot="R1", release=1.0),)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0))]
    world, logs = a_fleet(tmp_path, robots, orders, ["driver-error:R1@4"])
    say = operator(world)
    world.run(4.4)
    while (coming := world.fleet.grants.of("R1").next) is None or coming.is_withdrawn:
        world.step()
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    say(Said(9, "near", (4.0, 4.0), robot="R1"))
    world.run(9.5)
    say(Cancel(9, "far"))
    world.run(12.0)
    start_again(world, "R1", 79)
    world.run(40.0)
    logs.close()
    assert states(world)["near"] == ORDER_DONE
    assert_sound(world, logs)


def test_an_order_into_a_wall_is_refused_though_a_lost_robot_may_come_back():
    orders = (Order(id="far", goal=(12.0, 1.0), robot="R2", release=1.0),)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 6.0))]
    scenario = a_scenario(robots, size=HALL, obstacles=(box(6.0, 4.0, 9.0, 8.0),), orders=orders)
    world = a_world(scenario, faults=["kill:R2@4"], stays=True, planning_ns=150_000_000)
    world.run(25.0)
    assert world.fleet.grants.given_up == {"R2"}
    operator(world)(Said(9, "in", (7.5, 6.0), robot="R1"))
    world.run(5.0)
    assert states(world)["in"] == REFUSED
    told = world.fleet.orders.tasks["in"].reason
    assert told == "R1 cannot be at (7.50, 6.00), which is inside workspace.obstacles[0]"


def test_an_order_into_a_wall_is_refused_before_its_robot_is_free():
    orders = (Order(id="far", goal=(12.0, 1.0), robot="R1", release=1.0),)
    walls = (box(6.0, 4.0, 9.0, 8.0),)
    scenario = a_scenario([idle("R1", (1.0, 1.0))], size=HALL, obstacles=walls, orders=orders)
    world = a_world(scenario, stays=True, planning_ns=150_000_000)
    world.run(4.0)
    say = operator(world)
    say(Said(9, "in", (7.5, 6.0), robot="R1"))
    say(Said(9, "any", (7.5, 6.0)))
    say(Said(9, "beside", (5.75, 6.0), robot="R1"))
    world.run(0.5)
    assert states(world) == {"far": UNDER_WAY, "in": REFUSED, "any": REFUSED, "beside": WAITING}
    told = world.fleet.orders.tasks["any"].reason
    assert told == "no robot can be at (7.50, 6.00), which is inside workspace.obstacles[0]"


def test_a_lost_robot_with_two_unnamed_orders_stops_nobody(tmp_path):
    orders = (Order(id="a", goal=(8.0, 1.0)), Order(id="b", goal=(8.0, 5.0)))
    world, logs = a_fleet(tmp_path, [idle("R1", (1.0, 1.0))], orders, stays=False)
    while list(states(world).values()) != [UNDER_WAY] * 2:
        world.step()
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.run(60.0)
    logs.close()
    assert set(states(world).values()) == {REFUSED}


def test_of_a_robot_that_was_given_up_and_is_closed_in_it_is_told_by_whom():
    """R3 dies in the corridor that R1, which others went around, has to leave by."""
    orders = (
        Order(id="out", goal=(13.0, 7.0), robot="R1"),
        Order(id="in", goal=(9.0, 0.65), robot="R3", release=10.0),
    )
    scenario = a_scenario(
        [idle("R1", (1.0, 0.65)), idle("R3", (9.0, 6.0))],
        size=HALL,
        obstacles=[box(0.0, 1.3, 12.5, 2.0)],
        orders=orders,
    )
    world = a_world(
        scenario, faults=["cut:R1@4:50", "kill:R3@48"], planning_ns=150_000_000, stays=True
    )
    world.run(70.0)
    assert any("others go around R1" in one.text for one in world.fleet.incidents)
    task = world.fleet.orders.tasks["out"]
    for _ in range(24):
        assert (task.state, task.reason) == (WAITING, "waits for R3")
        world.run(0.5)


def test_where_a_robot_is_to_leave_its_course_outlasts_two_coordinators(tmp_path):
    """A place is opened between them; the first log's checkpoint states where the robot halts."""
    orders = (Order(id="a", goal=(12.0, 1.0), robot="R1", release=1.0),)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 5.0))]
    world, logs = a_fleet(tmp_path, robots, orders)
    say = operator(world)
    world.run(5.0)
    say(Block(9, "wet", box(13.0, 5.0, 13.5, 5.5)))
    world.run(1.0)
    say(Said(9, "b", (12.0, 4.0), robot="R1", now=True))
    while world.fleet.grants.of("R1").next is None:
        world.step()
    world.strike(Fault("cut", "R1", 1.0, 60.0))
    world.run(0.1)
    for pause in (2.0, 30.0):
        world.strike(Fault("coordinator-restart", "", 1.0, 1.0))
        world.run(pause)
        say(Unblock(9, "wet"))
        world.run(3.0)
    logs.close()
    for path in logs.paths:
        log = read_log(path)
        assert check_log(log).difference == ""
        assert prove_log(log, before=logs_before(log)).holds
    assert nobody_touches(world)


def test_the_log_states_that_a_robot_lost_for_long_was_given_up_for_its_unnamed_order(tmp_path):
    """R2 is sent across where R1 may not come any more; the log proves that."""
    orders = (
        Order(id="any", goal=(12.0, 3.0), release=1.0),
        Order(id="there", goal=(9.0, 3.0), robot="R2", release=22.0),
    )
    robots = [idle("R1", (1.0, 3.0)), idle("R2", (1.0, 7.0))]
    world, logs = a_fleet(tmp_path, robots, orders, ["kill:R1@5"])
    world.run(60.0)
    logs.close()
    assert states(world)["there"] == ORDER_DONE
    assert_sound(world, logs)


def test_no_course_is_committed_for_a_robot_that_was_lost_while_it_was_looked_for(tmp_path):
    orders = (Order(id="far", goal=(12.0, 1.0), robot="R1", release=1.0),)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 7.0))]
    world, logs = a_fleet(tmp_path, robots, orders, planning_ns=1_500_000_000)
    say = operator(world)
    world.run(6.0)
    say(Said(9, "a", (8.0, 4.0), robot="R1", now=True))
    while not world.mission.dispatcher.searches.has("R1"):
        world.step()
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.run(10.0)
    logs.close()
    assert world.fleet.grants.of("R1").next is None
    assert_sound(world, logs)


def test_a_robot_that_leaves_while_another_looks_for_a_way_past_it_is_no_trouble(tmp_path):
    robots = [idle("R1", (6.0, 4.0)), idle("R2", (1.0, 4.0))]
    world, logs = a_fleet(tmp_path, robots, planning_ns=1_500_000_000)
    say = operator(world)
    world.run(4.0)
    say(Said(9, "a", (6.0, 4.0), robot="R2"))
    while not world.mission.dispatcher.searches.has("R2"):
        world.step()
    say(Leave(9, "R1"))
    world.run(40.0)
    logs.close()
    assert "R1" not in world.fleet.members
    assert states(world)["a"] == ORDER_DONE


def test_a_robot_that_leaves_while_a_course_is_looked_for_gets_none(tmp_path):
    robots = [idle("R1", (6.0, 4.0)), idle("R2", (1.0, 4.0))]
    world, logs = a_fleet(tmp_path, robots, planning_ns=1_500_000_000)
    say = operator(world)
    world.run(4.0)
    say(Said(9, "a", (10.0, 4.0), robot="R1", now=True))
    while not world.mission.dispatcher.searches.has("R1"):
        world.step()
    say(Leave(9, "R1"))
    world.run(10.0)
    logs.close()
    assert "R1" not in world.fleet.members
    assert_sound(world, logs)


def test_a_program_that_is_not_admitted_gets_no_course_though_its_silence_is_excused(tmp_path):
    """The coordinator was away: robots have some seconds to be heard again."""
    world, logs = a_fleet(tmp_path, [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 7.0))])
    say = operator(world)
    world.run(4.0)
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.run(0.5)
    world.renew("R1", 78, world.robots["R1"].body.true_pose())
    world.run(0.5)
    world.strike(Fault("coordinator-restart", "", 1.0, 1.0))
    world.run(1.5)
    say(Said(9, "a", (8.0, 1.0), robot="R1"))
    world.run(10.0)
    assert world.robots["R1"].service.agent.ride is None
    admit(world, "R1")
    world.run(40.0)
    logs.close()
    assert states(world)["a"] == ORDER_DONE
    assert nobody_touches(world)
    log = read_log(logs.paths[-1])
    assert (check_log(log).difference, prove_log(log, before=logs_before(log)).holds) == ("", True)


def test_a_program_that_comes_while_silence_is_excused_gets_no_course_either(tmp_path):
    world, logs = a_fleet(tmp_path, [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 7.0))])
    say = operator(world)
    world.run(4.0)
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.strike(Fault("coordinator-restart", "", 1.0, 1.0))
    world.run(1.2)
    world.renew("R1", 78, world.robots["R1"].body.true_pose())
    say(Said(9, "a", (8.0, 1.0), robot="R1"))
    world.run(3.0)
    assert world.robots["R1"].service.agent.ride is None
    world.run(5.0)
    admit(world, "R1")
    world.run(20.0)
    logs.close()
    assert states(world)["a"] == ORDER_DONE
    assert nobody_touches(world)
    log = read_log(logs.paths[-1])
    assert (check_log(log).difference, prove_log(log, before=logs_before(log)).holds) == ("", True)


@pytest.mark.parametrize("starts", [0.37, 0.46, 0.57, 0.67])
def test_a_program_that_comes_after_an_order_while_silence_is_excused_gets_no_course_either(
    tmp_path, starts
):
    world, logs = a_fleet(tmp_path, [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 7.0))])
    say = operator(world)
    world.run(4.0)
    world.strike(Fault("kill", "R1", 1.0, 0.0))
    world.strike(Fault("coordinator-restart", "", 1.0, 1.0))
    world.run(1.2)
    say(Said(9, "a", (8.0, 1.0), robot="R1"))
    world.run(starts)
    world.renew("R1", 78, world.robots["R1"].body.true_pose())
    world.run(6.0)
    assert world.robots["R1"].service.agent.ride is None
    admit(world, "R1")
    world.run(20.0)
    logs.close()
    assert states(world)["a"] == ORDER_DONE
    assert nobody_touches(world)


def test_a_robot_that_joined_and_is_started_anew_waits_until_it_is_admitted(tmp_path):
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (1.0, 7.0))]
    world, logs = a_fleet(tmp_path, robots)
    say = operator(world)
    world.run(4.0)
    say(Join(9, "R3", (6.0, 4.0, 0.0), 0.2, 0.8, 0.8))
    world.run(2.0)
    world.add("R3", 0.2, 0.8, 31)
    world.robots["R3"].body.place(6.0, 4.0, 0.0)
    world.run(3.0)
    world.strike(Fault("kill", "R3", 1.0, 0.0))
    world.run(0.5)
    world.renew("R3", 78, world.robots["R3"].body.true_pose())
    say(Said(9, "a", (8.0, 1.0), robot="R3"))
    world.run(4.0)
    assert world.robots["R3"].service.agent.ride is None
    admit(world, "R3")
    world.run(20.0)
    logs.close()
    assert states(world)["a"] == ORDER_DONE
    assert_sound(world, logs)


def test_no_course_is_committed_through_a_robot_given_up_while_it_was_looked_for(tmp_path):
    orders = (Order(id="far", goal=(12.0, 4.0), robot="R1", release=1.0),)
    robots = [idle("R1", (1.0, 4.0)), idle("R2", (7.0, 1.0))]
    world, logs = a_fleet(tmp_path, robots, orders, planning_ns=9_000_000_000)
    say = operator(world)
    world.run(10.5)
    say(Said(9, "across", (7.0, 7.0), robot="R2"))
    while not world.mission.dispatcher.searches.has("R2"):
        world.step()
    world.strike(Fault("driver-error", "R1", 1.0, 0.0))
    while "R1" not in world.fleet.grants.given_up:
        world.step()
    assert world.mission.dispatcher.searches.has("R2")
    assert abs(world.robots["R1"].body.x - 7.0) < 1.0
    world.run(60.0)
    logs.close()
    assert states(world)["across"] == ORDER_DONE
    assert_sound(world, logs)


@pytest.mark.parametrize("dies", [False, True])
def test_others_keep_off_a_robot_that_was_pushed_on_along_its_course_and_admitted(tmp_path, dies):
    """R1 says where it has stopped, and only that place is solid; it is pushed on to where its
    authority ended, which R2 is on its way to.
    """
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (6.0, 5.0))]
    orders = (Order(id="far", goal=(12.0, 1.0), robot="R1", release=1.0),)
    logs = RunLogs(tmp_path)
    scenario = a_scenario(robots, size=HALL, orders=orders)
    world = a_world(scenario, planning_ns=150_000_000, logs=logs, stays=True)
    obstructions = world.mission.dispatcher.obstructions
    world.run(8.0)
    world.strike(Fault("driver-error", "R1", 0, 0))
    while "R1" not in obstructions.around:
        world.step()
    world.run(0.05)
    world.strike(Fault("kill", "R1", 0, 0))
    ride = world.fleet.grants.of("R1").now.course.driven
    (span,) = world.fleet.spans("R1")
    ((x, y),) = ride.curve.at_arc([ride.timeline.s_at(span.until_ms / 1000.0)]).tolist()
    assert x > max(x for x, _ in obstructions.around["R1"]) + 0.5
    operator(world)(Said(9, "across", (x, y), robot="R2"))
    world.run(4.3)
    world.renew("R1", 78, (x, y, 0.0))
    back_ns = world.now_ns
    world.run(0.3)
    admit(world, "R1")
    if dies:
        world.run(0.6)
        world.strike(Fault("kill", "R1", 0, 0))
    world.run(30.0)
    logs.close()
    back = (back_ns - world.began_ns) / SECOND
    boxes = [box.between(back, math.inf, 0.0) for box in world.blackboxes().values()]
    assert least_separation(*boxes)[0] > 0.4


@pytest.mark.parametrize("beside", [(0.95, 0.0), (0.0, 0.95)])
def test_a_robot_that_was_pushed_at_its_goal_touches_nobody_when_it_leaves(tmp_path, beside):
    """It is quick, starts and stops at once, and has to turn; R2 rests as near as it may."""
    quick = {"max_speed": 3.0, "max_accel": math.inf, "max_lateral_accel": 0.8}
    robots = [idle("R1", (1.0, 1.0), **quick), idle("R2", (5.428, 4.0))]
    orders = (Order(id="there", goal=(5.0, 4.0), robot="R1", via=((3.0, 4.0),), release=1.0),)
    logs = RunLogs(tmp_path)
    scenario = a_scenario(robots, size=HALL, orders=orders, margin=0.02)
    world = a_world(scenario, logs=logs, planning_ns=60_000_000, stays=True, flaws=NO_FLAWS)
    world.run(12.0)
    robot = world.robots["R1"]
    assert robot.service.agent.phase == DONE
    x, y, heading = robot.body.true_pose()
    track = robot.service.agent.ride.track
    robot.body.place(x + beside[0] * track, y + beside[1] * track, heading)
    world.run(1.0)
    operator(world)(Said(9, "on", (1.0, 4.0), robot="R1"))
    world.run(20.0)
    logs.close()
    assert states(world)["on"] == ORDER_DONE
    assert_sound(world, logs)


@pytest.mark.parametrize("is_broken", [False, True])
def test_the_log_shows_if_a_robot_that_was_pushed_off_its_goal_counts_as_there(
    tmp_path, monkeypatch, is_broken
):
    """R1 is pushed 0.8 m aside, says where it rests, and dies; R2 is to go there."""

    def as_if_at_its_goal(obstructions, robot):
        course = world.fleet.grants.of(robot).now.course
        places = obstructions._places(robot, course.driven)
        return Aside(obstructions._robots[robot], "lost", places, None)

    if is_broken:
        monkeypatch.setattr(Obstructions, "aside", as_if_at_its_goal)
    orders = (Order(id="there", goal=(4.0, 1.0), robot="R1", release=0.5),)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (8.0, 4.0))]
    world, logs = a_fleet(tmp_path, robots, orders, flaws=NO_FLAWS, planning_ns=60_000_000)
    world.run(10.0)
    x, y, heading = world.robots["R1"].body.true_pose()
    world.robots["R1"].body.place(x, y + 0.8, heading)
    while "R1" not in world.fleet.grants.given_up:
        world.step()
    world.strike(Fault("kill", "R1", 0.0, 0.0))
    world.run(8.0)
    operator(world)(Said(9, "over", (4.0, 1.8), robot="R2"))
    world.run(30.0)
    logs.close()
    assert nobody_touches(world) is not is_broken
    assert prove_log(read_log(logs.paths[-1])).holds is not is_broken


def test_robots_at_a_door_get_around_one_that_died_while_the_coordinator_was_away(tmp_path):
    """R1 waits at a stop for the dead R3: all that it may have been told, it has passed."""
    slow = {"max_speed": 0.5, "max_accel": 0.5}
    robots = [
        a_robot("R1", (1.0, 1.5), (9.0, 6.5), max_speed=0.6),
        a_robot("R2", (9.0, 1.5), (1.0, 6.5), max_speed=0.6),
        a_robot("R3", (1.0, 4.0), (9.0, 3.0), **slow),
        a_robot("R4", (9.0, 4.8), (1.0, 2.6), radius=0.25, **slow),
    ]
    wall = (box(4.5, 0.0, 5.5, 2.5), box(4.5, 5.0, 5.5, 8.0))
    logs = RunLogs(tmp_path)
    scenario = a_scenario(robots, obstacles=wall)
    faults = read_faults(["coordinator-restart@6:2", "kill:R3@7"], ["R3"])
    network, effort = MemoryNetwork(0), 20
    document = plan_scenario(scenario, effort=effort)
    how = {"seed": 0, "faults": faults, "flaws": USUAL_FLAWS, "effort": effort, "logs": logs}
    world = World(scenario, document, network, **how)
    world.run(90.0)
    logs.close()
    assert world.fleet.is_finished
    assert all(world.fleet.members[name].has_arrived for name in ("R1", "R2", "R4"))
    assert nobody_touches(world)
    log = read_log(logs.paths[-1])
    assert (check_log(log).difference, prove_log(log, before=logs_before(log)).holds) == ("", True)
