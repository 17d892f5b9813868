"""Messages that only a hostile or broken sender makes: both cores drop or refuse them alike."""

from __future__ import annotations

import random

import msgspec
import pytest

from protocol.codec import decode, encode
from protocol.curve import Curve, clamped_knots
from protocol.messages import Command, Plan
from protocol.phases import HOLD
from protocol.plan_bytes import pack_floats, pack_points, pack_profile, pack_stops
from protocol.timing import SECOND
from robot_agent.core.agent import BAD_PLAN
from tests.firmware.building import FIRMWARE, answers, compile_c
from tests.firmware.streams import ID, PERIOD_NS, SIZES, Robot, Robots, make_plan

pytestmark = pytest.mark.processes

READ_NS = 2 * SECOND
"""By then a Plan is read, a part in each tick."""

COMMAND = Command(7, 1, 1, 1, HOLD, 0, 0, 1500, (), 0, 2**32 - 1, (), 7)
POINTS = [(0.5 * i, 0.0) for i in range(9)]
KNOTS = [float(i) for i in range(1, 7)]
LENGTH = Curve(3, clamped_knots(3, KNOTS), [x for x, _ in POINTS], [0.0] * 9, [1.0] * 9).length


def heard(plan):
    """What the Python robot answers while it hears the plan for READ_NS, as a stream."""
    robots = Robots(Robot(ID, 0.2, 0.8, 0.5, SIZES), 5)
    robots.hear("command", encode(COMMAND))
    robots.hear("plan", encode(plan))
    robots.base.at = [0.0, 0.0, 0.0]
    for now_ns in range(SECOND, SECOND + READ_NS, PERIOD_NS):
        robots.tick(now_ns)
    return robots.stream


def straight(profile, stops, begin_ms=0):
    """A plan along the x axis with these speeds and stops, for a robot that does not brake."""
    path = (3, pack_points(POINTS), pack_floats(KNOTS), b"")
    motion = (*pack_profile(profile), pack_stops(stops))
    return Plan(1, 7, ID, 3, 0, begin_ms, SECOND, 50, 0, 10, *path, *motion)


@pytest.mark.parametrize("further", ["\0", "\0\0\0", "\0" * 262])
def test_a_plan_for_a_name_that_goes_on_behind_its_end_is_dropped(exact_core, robot_core, further):
    plan = make_plan(random.Random(1), 1, 0, 0, (0.0, 0.0, 0.0)).plan
    stream = heard(msgspec.structs.replace(plan, robot=ID + further))
    assert stream.ticks[-1].epoch == 0
    for core in (exact_core, robot_core):
        last = answers(core, stream.lines)[-1]
        assert (last.epoch, last.fault) == (0, 0)


@pytest.mark.parametrize("stops", [[], [(1.5, SECOND)]])
def test_speed_knots_that_do_not_rise_are_a_bad_plan(exact_core, robot_core, stops):
    stream = heard(straight([(0.0, 0.5), (2.0, 0.5), (1.0, 0.5), (LENGTH, 0.5)], stops))
    assert stream.ticks[-1].fault == BAD_PLAN
    for core in (exact_core, robot_core):
        last = answers(core, stream.lines)[-1]
        assert (last.epoch, last.fault) == (0, BAD_PLAN)


@pytest.mark.parametrize(("departs_ns", "begin_ms"), [(2**63 - 1, -5000), (-(2**63), 5000)])
def test_departures_at_the_ends_of_time_are_a_bad_plan(
    exact_core, robot_core, departs_ns, begin_ms
):
    profile = [(0.0, 0.5), (LENGTH, 0.5)]
    stream = heard(straight(profile, [(1.5, departs_ns)], begin_ms))
    assert stream.ticks[-1].fault == BAD_PLAN
    for core in (exact_core, robot_core):
        last = answers(core, stream.lines)[-1]
        assert (last.epoch, last.fault) == (0, BAD_PLAN)


def test_a_field_of_the_future_that_is_longer_than_any_message_is_not_taken(exact_core):
    payload = bytearray(encode(COMMAND))
    assert payload[0] == 0x9E
    payload[0] += 1
    payload += b"\xc9\xff\xff\xff\xff"
    assert decode("command", bytes(payload)) is None
    robots = Robots(Robot(ID, 0.2, 0.8, 0.5, SIZES), 5)
    robots.hear("command", bytes(payload))
    robots.hear("plan", encode(make_plan(random.Random(1), 1, 0, 0, (0.0, 0.0, 0.0)).plan))
    robots.base.at = [0.0, 0.0, 0.0]
    robots.tick(SECOND)
    assert answers(exact_core, robots.stream.lines) == robots.stream.ticks


def test_sizes_that_leave_no_cell_for_a_span_are_refused_by_the_compiler(tmp_path):
    source, made = str(FIRMWARE / "src" / "numbers.c"), str(tmp_path / "numbers.o")
    with pytest.raises(RuntimeError, match="SF_CELLS is less than SF_POINTS"):
        compile_c("-DSF_POINTS=300", "-c", source, "-o", made)
