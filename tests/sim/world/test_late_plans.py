"""Plans so late that their courses were withdrawn: robots may begin these all the same."""

import pytest

from coordinator.scenario.model import Order
from protocol.messages import ORDER_DONE
from protocol.messages import Order as Said
from protocol.phases import MOVING
from protocol.timing import SECOND
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from tests.sim.world.test_given_up_robots import a_fleet
from tests.sim.world.test_orders_in_time import assert_sound, idle, operator, states


class Stalled(MemoryNetwork):
    """A network in which nothing reaches R1 before a time; then all comes at once."""

    until_ns = 0

    def _launch(self, due, sender, receiver, key, payload):
        due = max(due, self.until_ns) if receiver.name == "R1" else due
        super()._launch(due, sender, receiver, key, payload)


def stop_and_stall(world, network, stall):
    """Let R1 stop by a fault, and nothing reach it for a time [s] once others go around it."""
    world.strike(Fault("driver-error", "R1", 0.0, 0.0))
    while "R1" not in world.fleet.grants.given_up:
        world.step()
    network.until_ns = world.now_ns + round(stall * SECOND)


def stopped_on_its_way(tmp_path, stall):
    """R1 stops; its next course comes so late that it may have been replaced by another one."""
    orders = (Order(id="far", goal=(12.0, 1.0), robot="R1", release=1.0),)
    robots = [idle("R1", (1.0, 1.0)), idle("R2", (4.0, 6.0))]
    network = Stalled(1)
    world, logs = a_fleet(tmp_path, robots, orders, network=network, planning_ns=60_000_000)
    world.run(5.0)
    stop_and_stall(world, network, stall)
    return world, logs


def assert_goes_on(world, logs):
    """R1 does its next order."""
    world.run(20.0)
    operator(world)(Said(9, "next", (12.0, 3.0), robot="R1"))
    world.run(30.0)
    logs.close()
    assert states(world)["next"] == ORDER_DONE
    assert_sound(world, logs)


@pytest.mark.parametrize("stall", [5.0, 5.3, 5.6])
def test_a_robot_that_begins_a_course_that_was_replaced_meanwhile_takes_the_newer_one(
    tmp_path, stall
):
    assert_goes_on(*stopped_on_its_way(tmp_path, stall))


def test_a_replaced_course_that_was_begun_counts_as_where_its_robot_stands(tmp_path):
    """R1 has begun the course that was replaced, stops on it, and is sent on from there."""
    world, logs = stopped_on_its_way(tmp_path, 5.3)
    while world.robots["R1"].service.agent.revision == 1:
        world.step()
    world.strike(Fault("driver-error", "R1", 0.0, 0.0))
    assert_goes_on(world, logs)


@pytest.mark.parametrize(("drives", "stall", "planning_ms"), [(2.2, 5.3, 60), (2.8, 5.5, 1500)])
def test_a_robot_that_begins_a_withdrawn_course_was_granted_nothing_more_on_the_one_before(
    tmp_path, drives, stall, planning_ms
):
    """R1 stops short of a crossing that R2, which stalls, has to pass first."""
    slow = {"max_speed": 0.4, "max_accel": 0.8, "max_lateral_accel": 0.4}
    robots = [idle("R1", (1.0, 1.5)), idle("R2", (3.3, 4.5), **slow), idle("R3", (12.0, 7.0))]
    orders = (Order(id="down", goal=(3.3, 0.4), robot="R2"),)
    network = Stalled(1)
    options = {"network": network, "planning_ns": planning_ms * 1_000_000}
    world, logs = a_fleet(tmp_path, robots, orders, **options)
    while world.robots["R2"].body.y > 2.6:
        world.step()
    operator(world)(Said(9, "far", (12.0, 1.5), robot="R1"))
    agent = world.robots["R1"].service.agent
    while agent.phase != MOVING or agent.revision == 0:
        world.step()
    world.strike(Fault("stall", "R2", 0.0, 60.0))
    world.run(drives)
    stop_and_stall(world, network, stall)
    world.run(80.0)
    logs.close()
    assert any(one.text == "R1 is moving" for one in world.fleet.incidents)
    assert_sound(world, logs)
