"""The recorded vectors of tests/golden/robot.json, read by both languages."""

from __future__ import annotations

import json
import math

import pytest

from protocol.phases import ARMED, BRAKING, DONE, FROZEN, IDLE, MOVING
from tests.firmware.building import answers
from tests.firmware.streams import play
from tests.golden.make_robot import ASIDE, BEND, SCENES, VECTORS, told

GOLDEN = json.loads(VECTORS.read_text())
NAMES = [scene.__name__ for scene in SCENES]


def numbers(states):
    return [
        [float.fromhex(word) if isinstance(word, str) else word for word in state]
        for state in states
    ]


def assert_same(name, ticks, **close):
    made, golden = told(ticks), GOLDEN[name]
    assert made["sent"] == golden["sent"]
    for state, expected in zip(numbers(made["states"]), numbers(golden["states"]), strict=True):
        assert state == pytest.approx(expected, **close)


def test_there_is_a_vector_per_scene():
    assert list(GOLDEN) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_the_python_agent_answers_as_recorded(name):
    assert_same(name, play(GOLDEN[name]["events"]), rel=1e-9, abs=1e-9)


@pytest.mark.processes
@pytest.mark.parametrize("name", NAMES)
def test_the_c_agent_answers_as_recorded(exact_core, name):
    assert_same(name, answers(exact_core, GOLDEN[name]["events"]), rel=1e-9, abs=1e-9)


@pytest.mark.processes
@pytest.mark.parametrize("name", NAMES)
def test_the_c_agent_in_float_changes_phase_within_a_moment_and_keeps_its_place(float_core, name):
    events = GOLDEN[name]["events"]
    ticks, expected = answers(float_core, events), play(events)
    for i, (made, wanted) in enumerate(zip(ticks, expected, strict=True)):
        near = expected[max(i - 15, 0) : i + 16]  # It creeps up to its goal for so long.
        assert (made.phase, made.fault) in {(tick.phase, tick.fault) for tick in near}
        assert made.place == pytest.approx(wanted.place, abs=1e-3)
        assert (made.epoch, made.revision, made.holds) == (
            wanted.epoch,
            wanted.revision,
            wanted.holds,
        )


@pytest.mark.parametrize(
    ("name", "phases"),
    [
        ("arrives", [IDLE, ARMED, MOVING, DONE]),
        ("authority", [IDLE, ARMED, MOVING, DONE]),
        ("stop", [IDLE, ARMED, MOVING, DONE]),
        ("freeze", [IDLE, ARMED, MOVING, BRAKING, FROZEN, IDLE]),
        ("pushed", [IDLE, ARMED, MOVING, BRAKING, FROZEN]),
        ("driver_fails", [IDLE, ARMED, MOVING, BRAKING, FROZEN]),
        ("late", [IDLE, ARMED, MOVING, DONE]),
        ("silence", [IDLE, ARMED, MOVING, DONE]),
        ("redirected", [IDLE, ARMED, MOVING, DONE, MOVING, DONE]),
        ("in_motion", [IDLE, ARMED, MOVING, DONE]),
        ("malformed", [IDLE, ARMED, MOVING]),
        ("newer", [IDLE, ARMED, MOVING]),
    ],
)
def test_the_vectors_show_what_they_are_about(name, phases):
    seen = [state[1] for state in GOLDEN[name]["states"]]
    assert [phase for i, phase in enumerate(seen) if i == 0 or phase != seen[i - 1]] == phases


def test_a_robot_that_changes_courses_in_motion_keeps_its_speed_all_the_way():
    states = numbers(GOLDEN["in_motion"]["states"])
    speeds = {revision: [] for revision in (0, 1)}
    for _, _, _, speed, *_, place, _, revision, _ in states:
        if revision or place > 0.3:
            speeds[revision].append(speed)
    assert min(speeds[0]) > 0.4 < min(speeds[1][: len(speeds[0])])
    *_, last = (line.split() for line in GOLDEN["in_motion"]["events"] if line.startswith("tick"))
    assert math.dist(map(float.fromhex, last[2:4]), ASIDE[-1]) < 2e-3


def test_a_robot_that_arrives_stands_where_its_control_points_end():
    *_, last = (line.split() for line in GOLDEN["arrives"]["events"] if line.startswith("tick"))
    x, y, heading = map(float.fromhex, last[2:])
    assert math.dist((x, y), BEND[-1]) < 2e-3
    assert heading == pytest.approx(math.pi / 2, abs=0.02)
