"""Who gets on, who is stuck, and who is kept from setting out by whom."""

import numpy as np

from coordinator.fleet.standstills import LATELY_MS, STUCK_MS, Standstills

ALL = np.ones(3, np.bool_)


def three():
    return Standstills(["R1", "R2", "R3"])


def test_a_robot_is_stuck_once_it_has_not_got_on_for_longer_than_is_patient():
    still = three()
    still.drive(1, 5_000, STUCK_MS)
    assert still.stuck(ALL, STUCK_MS) == set()
    assert still.stuck(ALL, STUCK_MS + 1) == {"R1", "R3"}
    assert still.stuck(np.array([True, True, False]), STUCK_MS + 1) == {"R1"}
    assert still.got_on_latest_ms == STUCK_MS


def test_a_robot_gets_on_as_long_as_it_has_done_so_lately():
    still = three()
    still.drive(0, 1_000, 4_000)
    assert still.gets_on(0, 4_000 + LATELY_MS)
    assert not still.gets_on(0, 4_000 + LATELY_MS + 1)


def test_time_in_which_nobody_could_be_heard_does_not_count():
    still = three()
    still.excuse(3_000)
    assert still.stuck(ALL, STUCK_MS + 3_000) == set()
    assert still.stuck(ALL, STUCK_MS + 3_001) == {"R1", "R2", "R3"}
    assert still.got_on_latest_ms == 3_000


def test_a_robot_is_kept_from_setting_out_until_its_course_is_committed():
    still = three()
    still.keep_from("R2", 0)
    still.keep_from("R3", 1)
    assert still.behind(["R1"]) == {"R2", "R3"}
    still.await_start(1, 7_000)
    assert still.behind(["R1"]) == set()
    assert still.behind(["R2"]) == {"R3"}
    assert (still.passed_ms[1], still.got_on_ms[1]) == (7_000, 7_000)


def test_a_robot_that_is_taken_out_holds_nobody_and_is_kept_from_nothing():
    still = three()
    still.keep_from("R2", 0)
    still.hold({2: 0}, 500)
    assert {(one.robot, one.by, one.since_ms) for one in still.held()} == {("R3", "R1", 500)}
    still.hold({2: 0, 1: None}, 900)
    assert [one.since_ms for one in still.held()] == [500]
    still.remove("R1", [0])
    assert still.kept_from == {}
    still.remove("R3", [2])
    assert still.held() == []
