"""Where a robot left its plan, told from reports: against motions integrated in small steps."""

import math

import pytest

from coordinator.findings.braking import Said
from protocol.messages import Report, Rest
from protocol.phases import BRAKING, DONE, FROZEN, MOVING
from protocol.timeline import Timeline
from protocol.timing import SECOND

ACCEL = 0.5
LINE = Timeline([0.0, 0.25, 2.75, 3.0], [0.0, 0.5, 0.5, 0.0], [], [])
START = 7 * SECOND


def said(*reports):
    """What R1 said in epoch 1; reports: (plan time [s], phase, rest [m] or None)."""
    words = Said()
    for number, (t, phase, rest) in enumerate(reports):
        told = None if rest is None else Rest(rest, 1)
        words.take(Report(1, number, 1, phase, 0, told), "R1", START + round(t * SECOND))
    return words.of(1, "R1")


def broken(words, frozen, rate=ACCEL):
    """When and how the robot left its plan (passed plan time [s], rate), or None."""
    end = None if frozen is None else START + frozen * SECOND
    _, *left = words.driving(LINE, rate, START, end)
    return None if left[0] == math.inf else tuple(left)


def rest_after_braking_from(t):
    s, v, step = LINE.s_at(t), LINE.v_at(t), 1e-5
    while v > 0.0:
        s, v = s + v * step, v - ACCEL * step
    return s


@pytest.mark.parametrize("t", [1.3, 2.5, 4.1])
def test_a_robot_braked_from_where_braking_at_its_rate_ends_at_its_rest(t):
    rest = rest_after_braking_from(t)
    words = said((t - 0.1, MOVING, None), (t + 0.05, BRAKING, None), (t + 1.2, FROZEN, rest))
    assert broken(words, 1) == (pytest.approx(t, abs=1e-4), ACCEL)
    assert broken(words, None) == (pytest.approx(t, abs=1e-4), ACCEL)


def test_a_robot_that_rests_sooner_than_braking_takes_was_stopped_where_it_was():
    words = said((3.0, BRAKING, None), (3.1, FROZEN, LINE.s_at(2.0)))
    assert broken(words, 3) == (pytest.approx(2.0, abs=1e-6), 0.0)


def test_a_robot_that_was_never_heard_braking_braked_evenly():
    rest = rest_after_braking_from(2.0)
    words = said((1.9, MOVING, None), (3.2, FROZEN, rest))
    assert broken(words, 2) == (pytest.approx(2.0, abs=1e-4), ACCEL)


def test_a_robot_that_is_not_heard_of_again_stands_where_it_was_last_heard():
    assert broken(said((1.5, MOVING, None)), 3) == (1.5, 0.0)
    assert broken(said((3.5, MOVING, None)), 3) == (3.0, 0.0)
    assert broken(said(), 3) == (3.0, 0.0)
    assert broken(said((1.5, MOVING, None)), None) is None


def test_a_robot_that_brakes_and_has_not_said_yet_where_it_rests_brakes_meanwhile():
    assert broken(said((2.9, MOVING, None), (3.1, BRAKING, None)), 3) == (3.1, ACCEL)


def test_a_robot_at_its_goal_has_not_left_its_plan():
    assert broken(said((5.0, MOVING, None), (7.0, DONE, None)), 8) is None
    assert broken(said((7.0, FROZEN, LINE.length)), 8) is None


def test_a_robot_that_drives_on_brakes_anew():
    words = said((1.0, BRAKING, None), (1.5, FROZEN, None), (2.0, MOVING, None))
    assert broken(words, 3) == (2.0, 0.0)
    words.take(Report(1, 4, 1, BRAKING), START + 3 * SECOND)
    assert broken(words, 3) == (3.0, ACCEL)


def test_the_first_word_about_where_a_robot_rests_counts():
    rest = rest_after_braking_from(2.0)
    words = said((3.0, FROZEN, rest), (9.0, FROZEN, rest + 0.4))
    assert math.isclose(words.rest, rest)
