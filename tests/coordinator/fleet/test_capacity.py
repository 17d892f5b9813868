"""A robot says what it can hold; one that cannot hold its course is named with both numbers."""

import pytest
from msgspec.structs import replace

from coordinator.fleet.events import Part
from coordinator.plan.capacity import Capacity
from coordinator.planning.planner import plan_fleet
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Hello, Refusal
from protocol.phases import FREEZE, IDLE
from protocol.plan_bytes import pack_points, pack_stops, unpack_points
from protocol.timing import REPORT_TIMEOUT
from tests.coordinator.fleet.fleet_floor import PARTS, Floor, frozen_but, grants
from tests.scenarios import a_robot, a_scenario

HALL = a_scenario([a_robot("R1", (1.0, 1.0), (9.0, 7.0))])


@pytest.fixture(scope="module")
def plan():
    """A Plan with two stops."""
    plan = decode("plan", plan_fleet(HALL, effort=0).messages["R1"])
    return replace(plan, stops=pack_stops([(0.0, 10**9), (1.0, 2 * 10**9)]))


def test_each_limit_that_is_passed_is_named_with_both_numbers(plan):
    payload, points = encode(plan), len(unpack_points(plan.points))
    size = Capacity(points, 2, len(payload))
    assert size.objection(payload) == Capacity().objection(payload) == ""
    assert Capacity(*(n - 1 for n in size)).objection(payload) == (
        f"cannot hold its course: {points} control points, it holds {points - 1}; "
        f"2 stops, it holds 1; {len(payload)} bytes, it holds {len(payload) - 1}"
    )
    assert Capacity(stops=1).objection(payload) == "cannot hold its course: 2 stops, it holds 1"


def test_a_robot_that_cannot_hold_its_first_course_is_refused_by_name(plan):
    floor = Floor()
    floor.fleet.members["R2"].plan = encode(plan)
    (sent,) = floor.hello("R2", stops=1)
    assert sent.key == keys.plan("hall", "R2")
    refusal = decode("plan", sent.payload)
    assert isinstance(refusal, Refusal)
    assert refusal.reason == "R2 cannot hold its course: 2 stops, it holds 1"
    assert floor.fleet.incidents[-1].text == refusal.reason
    (sent,) = floor.hello("R2", stops=2)
    assert sent.payload == encode(plan)
    floor.report("R2", IDLE)
    floor.tick(2 * REPORT_TIMEOUT)
    (sent,) = floor.hello("R2", boot=2, stops=1)
    assert isinstance(decode("plan", sent.payload), Refusal)


def test_a_later_course_that_a_robot_cannot_hold_is_planned_anew_without_it(plan):
    floor = frozen_but("R2")
    floor.fleet.members["R3"].accept(Hello(2, 8, points=5), floor.now)
    long = replace(plan, points=pack_points([(float(i), 0.0) for i in range(6)]))
    parts = {"R1": PARTS["R1"], "R3": Part(encode(long), 0.5)}
    floor.take(floor.fleet.adopt(2, parts, floor.now, grants()))
    for robot, boot in (("R1", 1), ("R3", 8)):
        floor.report(robot, IDLE, boot=boot, epoch=2)
    floor.tick()
    assert floor.commands[-1].phase == FREEZE
    assert floor.fleet.incidents[-2].text == (
        "R3 cannot hold its course: 6 control points, it holds 5"
    )
    states = {one.robot: one.state for one in floor.fleet.standings()}
    assert states["R3"] == "overloaded"
    assert states["R1"] == "rests"
