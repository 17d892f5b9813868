"""Where robots are on the next floor, and what operators have said before it, in virtual time."""

import math

import pytest
from msgspec.structs import replace

from coordinator.findings.log_proof import prove_log
from coordinator.log.log_file import logs_before, read_log
from coordinator.plan.plan_file import from_json, to_json
from coordinator.service.replay import check_log
from protocol.messages import (
    END,
    GO_ON,
    HALT,
    ORDER_DONE,
    REFUSED,
    Cancel,
    Join,
    Leave,
    Order,
    Tell,
)
from protocol.phases import FREEZE, HOLD, OVER, STOP
from sim.world.fault_text import Fault
from sim.world.run_logs import RunLogs
from tests.scenarios import box
from tests.sim.world.test_orders_in_time import a_world, idle, long_hall, operator, states

WALLS = [box(5.0, 0.0, 9.0, 2.6), box(5.0, 3.4, 9.0, 6.0)]
PALLET = box(11.3, 0.3, 11.6, 0.6)


def change_floor(world, scenario):
    world.coordinator.die()
    world.go_on(3.0)
    floor = replace(scenario.workspace, obstacles=(*scenario.workspace.obstacles, PALLET))
    world.coordinator.come_back(replace(scenario, workspace=floor))


def held_behind_a_dead_robot(logs):
    """R3 has no way around R4, which died in a corridor, and rests on its way to (10, 5)."""
    robots = idle("R1", (1.0, 1.0)), idle("R3", (1.0, 3.0)), idle("R4", (3.0, 3.0))
    scenario = long_hall(*robots, obstacles=WALLS)
    world = a_world(scenario, stays=True, logs=logs)
    say = operator(world)
    world.run(3.0)
    say(Order(9, "ahead", (11.0, 3.0), "R4"))
    world.run(0.5)
    say(Order(9, "behind", (10.0, 5.0), "R3"))
    world.run(6.5)
    world.strike(Fault("kill", "R4", 0.0))
    world.run(50.0)
    return world, scenario, say


def never_sent(logs):
    """R3 is heard, but no course to (11, 5) reaches it: it is withdrawn, and R3 stays at (6, 3)."""
    scenario = long_hall(idle("R1", (1.0, 1.0)), idle("R3", (6.0, 3.0)))
    world = a_world(scenario, stays=True, logs=logs)
    world.run(3.0)
    fate = world._network._fate
    world._network._fate = lambda key, now: None if key.endswith("plan/R3") else fate(key, now)
    say = operator(world)
    say(Order(9, "far", (11.0, 5.0), "R3"))
    world.run(24.0)
    world._network._fate = fate
    say(Cancel(9, "far"))
    world.run(0.1)
    return world, scenario, say


@pytest.mark.parametrize("made", [held_behind_a_dead_robot, never_sent])
def test_who_rests_elsewhere_than_where_it_was_sent_is_solid_there_on_the_next_floor(
    made, tmp_path
):
    logs = RunLogs(tmp_path)
    world, scenario, say = made(logs)
    world.strike(Fault("cut", "R3", 0.0, 60.0))
    change_floor(world, scenario)
    world.run(40.0)
    silent = world.robots["R3"].body
    say(Order(9, "through", (silent.x - 0.25, silent.y), "R1"))
    least = math.inf
    for _ in range(300):
        world.run(0.1)
        body = world.robots["R1"].body
        least = min(least, math.dist((body.x, body.y), (silent.x, silent.y)))
    assert least > 0.4
    assert states(world)["through"] == REFUSED
    say(Tell(9, END))
    world.run(100.0)
    logs.close()
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds
    assert prove_log(open_where_r3_stands(log), before=logs_before(log)).holds is False


def open_where_r3_stands(log):
    """The log with a newest plan on whose floor nothing is closed about robots without a part."""
    name = max(one for one in log.attachments if one.startswith("plan-"))
    document = from_json(log.attachments[name])
    floor = document.workspace
    keep = [one for one in floor.obstacles if len(one) <= 8]
    assert len(keep) < len(floor.obstacles)
    opened = replace(document, workspace=replace(floor, obstacles=keep))
    return replace(log, attachments={**log.attachments, name: to_json(opened)})


def sent_off(logs=None):
    scenario = long_hall(idle("R1", (1.0, 1.0)), idle("R3", (1.0, 3.0)))
    world = a_world(scenario, stays=True, logs=logs)
    world.run(3.0)
    say = operator(world)
    say(Order(9, "far", (11.0, 3.0), "R3"))
    world.run(4.0)
    return world, scenario, say


@pytest.mark.parametrize("when", [STOP, FREEZE, HOLD])
def test_a_stop_holds_before_on_and_after_a_change_of_floor(when, tmp_path):
    logs = RunLogs(tmp_path)
    world, scenario, say = sent_off(logs)
    if when == STOP:
        say(Tell(9, HALT))
        world.run(3.0)
    change_floor(world, scenario)
    while world.fleet.phase not in (when, STOP):
        world.step()
    say(Tell(9, HALT))
    world.run(20.0)
    place = world.robots["R3"].body.x
    assert (world.fleet.phase, states(world)["far"]) != (STOP, ORDER_DONE)
    world.run(5.0)
    assert world.robots["R3"].body.x == place
    say(Tell(9, GO_ON))
    world.run(40.0)
    assert states(world)["far"] == ORDER_DONE
    logs.close()
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    assert prove_log(log, before=logs_before(log)).holds


def test_a_fleet_that_is_stopped_before_it_first_sets_out_waits_for_the_word_to_go():
    world = a_world(long_hall(idle("R1", (1.0, 1.0))), stays=True)
    say = operator(world)
    say(Tell(9, HALT))
    world.run(5.0)
    assert world.fleet.phase == STOP
    say(Order(9, "far", (11.0, 3.0), "R1"))
    say(Tell(9, GO_ON))
    world.run(30.0)
    assert states(world)["far"] == ORDER_DONE


def test_a_robot_that_is_pushed_while_the_fleet_arms_does_not_keep_it_from_setting_out(tmp_path):
    scenario = long_hall(idle("R1", (1.0, 1.0)), idle("R3", (6.0, 3.0)))
    logs = RunLogs(tmp_path)
    world = a_world(scenario, stays=True, logs=logs)
    world.run(5.0)
    change_floor(world, scenario)
    while world.fleet.phase != HOLD:
        world.step()
    body = world.robots["R3"].body
    body.place(body.x + 0.3, body.y, body.heading)
    operator(world)(Order(9, "far", (11.0, 1.0), "R1"))
    world.run(80.0)
    logs.close()
    assert states(world)["far"] == ORDER_DONE


def test_courses_after_a_change_of_floor_may_turn_as_tightly_as_those_before(tmp_path):
    logs = RunLogs(tmp_path)
    scenario = long_hall(idle("R1", (1.0, 1.0)), idle("R3", (6.0, 3.0)))
    world = a_world(scenario, stays=True, logs=logs)
    world.run(5.0)
    change_floor(world, scenario)
    world.run(10.0)
    say = operator(world)
    for number, via in enumerate([((9.0, 5.0), (8.6, 5.0)), ((5.0, 1.3), (5.0, 1.2), (5.1, 1.3))]):
        say(Order(9, f"o{number}", (1.0, 1.02 + 0.02 * number), "R1", via=via))
        world.run(60.0)
    say(Tell(9, END))
    world.run(30.0)
    logs.close()
    assert (world.fleet.phase, world.fleet.epoch) == (OVER, 2)
    log = read_log(logs.paths[-1])
    assert prove_log(log, before=logs_before(log)).holds


def test_a_leave_that_is_said_again_does_not_take_out_who_has_joined_since():
    world, _, say = sent_off()
    world.run(30.0)
    say(Leave(5, "R3"))
    world.run(0.5)
    world.strike(Fault("kill", "R3", 0.0))
    world.run(0.5)
    say(Join(9, "R3", (6.0, 5.0, 0.0), 0.2, 0.8))
    world.run(0.1)
    world.renew("R3", 777, (6.0, 5.0, 0.0))
    for _ in range(20):
        world.run(0.2)
        say(Leave(5, "R3"))
    assert "R3" in world.fleet.members
    assert states(world)["join-R3"] == ORDER_DONE
    say(Leave(6, "R3"))
    world.run(0.2)
    assert "R3" not in world.fleet.members


def test_a_robot_that_was_to_join_before_a_change_of_floor_joins_after_it(tmp_path):
    logs = RunLogs(tmp_path)
    world, scenario, say = sent_off(logs)
    say(Join(5, "R7", (6.0, 5.0, 0.0), 0.2, 0.8))
    world.run(0.02)
    change_floor(world, scenario)
    world.run(5.0)
    world.add("R7", 0.2, 0.8, 77)
    world.run(40.0)
    assert states(world)["join-R7"] == ORDER_DONE
    say(Tell(9, END))
    world.run(30.0)
    logs.close()
    log = read_log(logs.paths[-1])
    assert world.fleet.epoch == 2
    assert prove_log(log, before=logs_before(log)).holds
