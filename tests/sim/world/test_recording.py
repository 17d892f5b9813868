"""The rows of a black box in virtual time."""

import numpy as np
import pytest

from protocol.phases import DONE, MOVING, PHASE_NAMES
from sim.world.recording import Recording


def recorded(*rows):
    recording = Recording()
    for row in rows:
        recording.add(row)
    return recording


def at(t, x=1.0, s=0.5, phase=MOVING, ahead=0.0):
    return t, x, 2.0, 0.25, s, phase, None if ahead is None else t + ahead


def told(row):
    return *row[:5], PHASE_NAMES[row[5]], row[6]


def test_every_row_of_a_robot_that_moves_is_kept():
    rows = [at(0.1 * i, x=0.01 * i) for i in range(5)]
    assert recorded(*rows).rows() == [told(row) for row in rows]


def test_of_a_robot_that_stands_the_first_and_the_last_row_are_kept():
    rows = [at(0.0, x=0.9), *(at(0.1 * i) for i in range(1, 9)), at(0.9, x=1.1)]
    assert recorded(*rows).rows() == [told(rows[i]) for i in (0, 1, 8, 9)]


@pytest.mark.parametrize("change", [{"s": 0.6}, {"phase": DONE}, {"ahead": 0.002}, {"ahead": None}])
def test_a_row_that_differs_in_more_than_its_time_is_kept(change):
    rows = [at(0.0), at(0.1), at(0.2), at(0.3, **change), at(0.4, **change), at(0.5, **change)]
    assert recorded(*rows).rows() == [told(rows[i]) for i in (0, 2, 3, 5)]


def test_a_black_box_holds_the_rows():
    rows = [at(0.0), at(0.1, x=1.5, ahead=None), at(0.2, x=2.0, phase=DONE)]
    recording = recorded(*rows)
    box = recording.blackbox()
    assert recording.last_phase == DONE
    assert box.t.tolist() == [0.0, 0.1, 0.2]
    assert box.places.tolist() == [[1.0, 2.0], [1.5, 2.0], [2.0, 2.0]]
    assert box.s.tolist() == [0.5, 0.5, 0.5]
    assert box.phases == tuple(PHASE_NAMES[phase] for phase in (MOVING, MOVING, DONE))
    np.testing.assert_equal(box.estimates, [0.0, np.nan, 0.2])


def test_an_empty_recording_is_an_empty_black_box():
    recording = Recording()
    assert recording.last_phase == -1
    assert recording.rows() == []
    assert len(recording.blackbox().t) == 0
