"""Documents to bytes and back: the robot reads what the document says, to the bit."""

import math
import random
import re

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.base.errors import InputError
from coordinator.curves.nurbs import nurbs
from coordinator.plan import wire
from coordinator.plan.document import Path
from coordinator.plan.plan_file import from_json, to_json
from coordinator.plan.wire import address, drive, float32, float32_below, pack, unpack
from coordinator.planning.planner import plan_scenario
from protocol.messages import MAX_MESSAGE_BYTES
from tests.oracles import tracks
from tests.scenarios import a_robot, a_scenario, box


@pytest.fixture(scope="module", params=[0.8, float("inf")])
def document(request):
    robots = [
        a_robot("A", (1, 4), (9, 4.3), max_accel=request.param),
        a_robot("B", (5, 1), (5.2, 7), max_speed=0.6, max_accel=request.param),
        a_robot("C", (1, 1, 0.4), (9, 7), via=((3, 6),), max_accel=request.param),
    ]
    return plan_scenario(a_scenario(robots, obstacles=[box(6, 2, 7, 3)]))


def test_bytes_hold_exactly_the_documents_numbers(document):
    for robot in document.robots:
        driven = unpack(pack(document, robot, 0), robot.radius)
        curve, line = driven.curve, driven.timeline
        assert curve.degree == robot.path.degree
        assert curve.knots.tolist() == robot.path.knots
        assert [tuple(p) for p in curve.points.tolist()] == robot.path.control_points
        assert curve.weights.tolist() == robot.path.weights
        assert line.length == robot.length
        assert line.finish == pytest.approx(robot.finish_time, abs=1e-8)
        for s, v in robot.profile[1:-1]:
            time = line.t0[line.s0.index(s)]
            assert line.v_at(time) == pytest.approx(v, abs=1e-9)


def test_the_robot_is_where_the_documents_numbers_put_it(document):
    for track, driven in zip(tracks(to_json(document)), drive(document), strict=True):
        time = np.linspace(-1.0, track.finish + 1.0, 400)
        s = np.array([driven.timeline.s_at(t) for t in time.tolist()])
        np.testing.assert_allclose(track.arc(time), s, atol=1e-6)
        np.testing.assert_allclose(track.at(time), driven.curve.at_arc(s), atol=1e-4)


def test_the_robot_rests_at_every_stop_from_arrival_to_departure(document):
    for robot, driven in zip(document.robots, drive(document), strict=True):
        assert driven.timeline.s_at(robot.start_time) == 0.0
        for stop in robot.stops:
            for time in (stop.arrive, 0.5 * (stop.arrive + stop.depart), stop.depart):
                assert driven.timeline.s_at(time) == pytest.approx(stop.s, abs=1e-6)


def test_wire_bytes_is_the_size_of_the_message_and_fits(document):
    for number, robot in enumerate(document.robots):
        assert len(address(pack(document, robot, number), 2**32 - 1)) == robot.wire_bytes
        assert robot.wire_bytes <= MAX_MESSAGE_BYTES


def test_a_document_read_from_json_gives_the_same_bytes(document):
    again = from_json(to_json(document))
    assert again == document
    pairs = zip(document.robots, again.robots, strict=True)
    for number, (robot, same) in enumerate(pairs):
        assert pack(document, robot, number) == pack(again, same, number)


def test_damaged_bytes_are_refused(document):
    robot, dice = document.robots[2], random.Random(1)
    payload = pack(document, robot, 2)
    for cut in range(0, len(payload), 7):
        with pytest.raises(ValueError, match=r"\w"):
            unpack(payload[:cut], robot.radius)
    for _ in range(200):
        damaged = bytearray(payload)
        damaged[dice.randrange(len(damaged))] ^= 1 << dice.randrange(8)
        with pytest.raises(ValueError, match=r"\w"):
            unpack(bytes(damaged), robot.radius)


def broken(robot, **path):
    fields = {name: getattr(robot.path, name) for name in Path.__struct_fields__}
    return replace(robot, path=Path(**fields | path))


def test_what_a_robot_would_not_accept_is_an_input_error_naming_it(document):
    robot = document.robots[2]
    knots, points = robot.path.knots, robot.path.control_points
    bad = [
        broken(robot, knots=knots[:-1]),
        broken(robot, knots=[*knots[:4], *knots[4:][::-1]]),
        broken(robot, control_points=points[:2]),
        broken(robot, control_points=[(1e39, 0.0), *points[1:]]),
        broken(robot, control_points=[(float("nan"), 0.0), *points[1:]]),
        broken(robot, weights=[-1.0, *robot.path.weights[1:]]),
        broken(robot, control_points=[points[0]] * len(points)),
        broken(robot, degree=0),
        replace(robot, profile=[]),
        replace(robot, profile=robot.profile[:-1]),
        replace(robot, profile=[*robot.profile, (1e3, 0.5)]),
        replace(robot, profile=[(s, 0.0) for s, _ in robot.profile]),
        replace(robot, profile=[robot.profile[0], *robot.profile]),
        replace(robot, start_time=float("1e8")),
        replace(robot, id="no name"),
    ]
    for one in bad:
        with pytest.raises(InputError, match="robots"):
            drive(replace(document, robots=[*document.robots[:2], one]))


def test_the_widest_margin_fits_into_a_message(document):
    wide = replace(document, margin=1e5)
    assert drive(wide)[0].plan.track_mm == 65_535


def test_float32_below_is_below():
    dice = random.Random(2)
    for _ in range(500):
        value = dice.uniform(0.0, 3.0)
        low = float32_below(value)
        assert low <= value < np.nextafter(np.float32(low), np.float32(9.0)).item()
        assert float32([low]) == [low]


def laps(radius, quarters):
    """A circle driven so many quarters of a turn, to the bit of the wire."""
    angles = np.arange(2 * quarters + 1) * math.pi / 4
    far = np.where(np.arange(len(angles)) % 2, math.sqrt(2.0), 1.0) * radius
    points = np.column_stack((far * np.cos(angles), far * np.sin(angles)))
    knots = np.repeat(np.arange(quarters + 1.0), 2)
    weights = np.where(np.arange(len(angles)) % 2, math.sqrt(0.5), 1.0)
    return nurbs(2, [0.0, *knots, quarters], points.astype(np.float32), weights.astype(np.float32))


@pytest.mark.parametrize("radius", [0.01, 0.05, 0.3, 2.0])
@pytest.mark.parametrize("quarters", [3, 11, 31])
def test_tight_bends_leave_no_doubt_of_the_arc_length(radius, quarters):
    curve = laps(radius, quarters)
    assert curve.length == pytest.approx(0.5 * math.pi * radius * quarters, rel=1e-5)
    chain = wire.flatten(curve, wire.FLAT)
    assert wire._arc_error(wire.measured(curve), curve, chain) < 1e-5


def test_a_length_that_is_out_is_told_with_its_size_and_place():
    curve = laps(0.3, 11)
    chain, length = wire.flatten(curve, wire.FLAT), curve.length
    allowed = 2.5e-4 + 1e-4 * length
    for share in (-1.3, 1.3):
        table = curve._table
        longer = table.s + (table.s > 2.0) * share * allowed
        vars(curve)["_table"] = table._replace(s=longer)
        vars(curve)["length"] = length + share * allowed
        with pytest.raises(ValueError, match="uncertain by") as refusal:
            wire._check_length(curve, chain)
        size, x, y = map(float, re.findall(r"-?\d+(?:\.\d+)?", str(refusal.value)))
        assert size == pytest.approx(1.3e3 * allowed, rel=0.15)
        assert math.hypot(x, y) == pytest.approx(0.3, abs=0.01)
        assert abs(math.atan2(y, x) - (2.0 / 0.3 - 2.0 * math.pi)) < 0.2
        del vars(curve)["_table"], vars(curve)["length"]


def test_a_message_is_not_read_without_a_check_of_its_length(document, monkeypatch):
    def refuse(_curve, _chain):
        raise ValueError("the length is out")

    robot = document.robots[0]
    payload = pack(document, robot, 0)
    monkeypatch.setattr(wire, "_check_length", refuse)
    with pytest.raises(ValueError, match="the length is out"):
        unpack(payload, robot.radius)
