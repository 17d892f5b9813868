"""The C core against the Python core: the same events, the same answers."""

from __future__ import annotations

from itertools import pairwise

import pytest

from tests.firmware.building import answers
from tests.firmware.streams import Trial

TICKS = 1500
SEEDS = range(20)

pytestmark = pytest.mark.processes


@pytest.mark.parametrize("seed", [*SEEDS, 157, 285])  # 157: asked where it is; 285: rounding.
def test_both_cores_answer_to_the_last_bit_alike_whatever_happens(exact_core, seed):
    stream = Trial(seed).stream(TICKS)
    ticks = answers(exact_core, stream.lines)
    assert len(ticks) == len(stream.ticks)
    for number, (told, expected) in enumerate(zip(ticks, stream.ticks, strict=True)):
        assert told == expected, f"tick {number}"


@pytest.mark.parametrize("seed", range(6))
def test_both_cores_drive_alike_where_knots_and_points_repeat(exact_core, seed):
    stream = Trial(seed, trouble=0.3, repeats=True).stream(TICKS)
    assert answers(exact_core, stream.lines) == stream.ticks


@pytest.mark.parametrize("seed", [*range(4), 19, 29, 40])  # 19 on: stuck near tight bends.
def test_both_cores_drive_alike_where_courses_turn_sharply(exact_core, seed):
    stream = Trial(seed, trouble=0.3, tight=True).stream(TICKS)
    assert answers(exact_core, stream.lines) == stream.ticks


@pytest.mark.parametrize("seed", range(4))
def test_stamps_that_are_centuries_apart_overflow_nothing(exact_core, robot_core, seed):
    stream = Trial(seed, absurd=True).stream(TICKS)
    assert answers(exact_core, stream.lines) == stream.ticks
    assert len(answers(robot_core, stream.lines)) == TICKS


@pytest.mark.parametrize("seed", [*range(8), 1010])  # 1010: it is granted the same on two courses.
def test_a_core_in_float_has_the_same_phases_and_places_to_a_millimetre(float_core, seed):
    stream = Trial(seed, trouble=0.0).stream(2 * TICKS)
    ticks = answers(float_core, stream.lines)
    assert [tick.phase for tick in ticks] == [tick.phase for tick in stream.ticks]
    for told, expected in zip(ticks, stream.ticks, strict=True):
        assert told.place == pytest.approx(expected.place, abs=1e-3)
        assert told.speed == pytest.approx(expected.speed, abs=0.1)
        assert [kind for kind, _ in told.sent] == [kind for kind, _ in expected.sent]


def test_the_streams_reach_every_phase_and_newer_courses():
    streams = [Trial(seed).stream(TICKS).ticks for seed in SEEDS]
    ticks = [tick for stream in streams for tick in stream]
    assert {tick.phase for tick in ticks} == set(range(6))
    assert {tick.fault for tick in ticks} >= {0, 1, 2, 3}
    assert max(tick.revision for tick in ticks) > 1
    steps = [step for stream in streams for step in pairwise(stream)]
    in_motion = [b for a, b in steps if b.revision > a.revision and b.place > 0.1 < b.speed]
    assert len(in_motion) > 2
    assert {kind for tick in ticks for kind, _ in tick.sent} == {"hello", "clock", "report"}


@pytest.mark.parametrize("seed", range(6))
def test_a_robot_that_reads_its_plan_over_several_ticks_drives_like_the_others(robot_core, seed):
    stream = Trial(seed, trouble=0.0, courses=False, go_after=300).stream(TICKS)
    ticks = answers(robot_core, stream.lines)
    reading = sum(tick.reads for tick in ticks)
    assert 5 < reading < 250
    for told, expected in list(zip(ticks, stream.ticks, strict=True))[300:]:
        assert (told.phase, told.fault) == (expected.phase, expected.fault)
        assert told.place == pytest.approx(expected.place, abs=1e-3)
