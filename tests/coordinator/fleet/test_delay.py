"""A late robot: the others go on for as long as tau allows, get new times in time, or freeze."""

from __future__ import annotations

import pytest

from coordinator.fleet.core import Fleet
from coordinator.fleet.delay import TELLING, THINKING, Delay
from coordinator.fleet.epoch_times import EpochTimes
from coordinator.fleet.log_records import LINK_GONE
from protocol import keys
from protocol.codec import decode, encode, seal
from protocol.messages import NewTimes, Pace
from protocol.phases import (
    BRAKING,
    DRIVER_ERROR,
    FREEZE,
    FROZEN,
    GO,
    LATE,
    MOVING,
    NO_FAULT,
    OFF_PATH,
)
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND
from tests.coordinator.fleet.fleet_floor import DURATION, NAMES, Floor

TAU = 2 * SECOND
SETTLING = SECOND
BEHIND = 300 * MILLISECOND


class LateFloor(Floor):
    """Three robots on their way, whose plan has a tau."""

    def __init__(self, tau=TAU):
        super().__init__()
        members = list(self.fleet.members.values())
        times = EpochTimes(1, DURATION, SETTLING, BEHIND)
        self.fleet = Fleet("hall", 77, members, times, Delay(tau))
        self.go()
        for _ in range(10):
            self.pass_time()

    def pass_time(self, ticks=1, moving=NAMES):
        for _ in range(ticks):
            for robot in moving:
                self.report(robot, MOVING)
            self.tick()

    def pace(self, robot, revision, stood_us=None):
        self.hear(keys.report("hall", robot), Pace(1, 1, revision, stood_us))

    def stand(self, robot="R1", ago=0.3):
        """Have a robot stand where its plan had it a while ago."""
        self.report(robot, FROZEN, fault=LATE)
        stood = (self.now - self.fleet.times.start_ns) // 1000 - round(1e6 * ago)
        self.pace(robot, self.fleet.members[robot].revision, stood)
        return stood

    def plan_messages(self, sent):
        return [decode("plan", one.payload) for one in sent if "/plan/" in one.key]

    @property
    def said(self):
        return [one.text for one in self.fleet.incidents if one.kind in ("late", "fault")]


def new_times(revision=1):
    return encode(seal(NewTimes(1, 77, revision, 0, b"", b"", b"", 0)))


def test_a_late_robot_does_not_freeze_the_fleet_at_once_and_is_asked_about_once():
    floor = LateFloor()
    floor.report("R1", BRAKING, fault=LATE)
    assert floor.fleet.late() is None
    stood = floor.stand()
    late = floor.fleet.late()
    assert (late.robot, late.stood) == ("R1", stood / 1e6)
    switch = (floor.now - floor.fleet.times.start_ns + THINKING + TELLING + SETTLING) / SECOND
    assert late.switch == pytest.approx(switch)
    assert floor.fleet.late() is None
    assert floor.fleet.phase == GO


def test_any_other_fault_freezes_at_once():
    floor = LateFloor()
    floor.report("R1", BRAKING, fault=DRIVER_ERROR)
    assert floor.commands[-1].phase == FREEZE


def test_without_room_in_tau_a_late_robot_freezes_the_fleet_at_once():
    floor = LateFloor(tau=SETTLING + BEHIND - MILLISECOND)
    floor.report("R1", BRAKING, fault=LATE)
    assert floor.commands[-1].phase == FREEZE


def test_the_fleet_freezes_before_plan_times_can_differ_by_more_than_tau():
    floor = LateFloor()
    stood = floor.stand()
    while floor.fleet.phase == GO:
        floor.pass_time(moving=("R2", "R3"))
        floor.report("R1", FROZEN, fault=LATE)
    rests = floor.now + SETTLING - floor.fleet.times.start_ns
    assert rests - 1000 * stood <= TAU + COMMAND_PERIOD
    assert floor.said[-1] == "R1 is late, and new times did not come through"


def test_new_times_are_told_again_until_all_have_said_that_they_have_them():
    floor = LateFloor()
    floor.stand()
    late = floor.fleet.late()
    message = new_times()
    sent = floor.fleet.take_times(late, {"R1": message, "R2": message}, DURATION, floor.now)
    assert [one.key for one in sent] == [keys.plan("hall", "R1"), keys.plan("hall", "R2")]
    assert len(floor.plan_messages(floor.tick())) == 2
    floor.pace("R2", 1)
    assert [one.key for one in floor.tick() if "/plan/" in one.key] == [keys.plan("hall", "R1")]
    floor.report("R1", MOVING)
    floor.pace("R1", 1)
    assert floor.plan_messages(floor.tick()) == []
    floor.pass_time(20)
    assert (floor.fleet.phase, floor.fleet.revision) == (GO, 1)
    assert floor.said[-1] == "R1 drives on later; all have new times"


def test_whoever_does_not_get_the_new_times_is_stopped_before_the_switch():
    floor = LateFloor()
    floor.stand()
    late = floor.fleet.late()
    floor.fleet.take_times(late, {"R1": new_times(), "R2": new_times()}, DURATION, floor.now)
    floor.report("R1", MOVING)
    floor.pace("R1", 1)
    while floor.fleet.phase == GO:
        floor.pass_time()
    rests = (floor.now + SETTLING - floor.fleet.times.start_ns) / SECOND
    assert rests <= late.switch + COMMAND_PERIOD / SECOND


def test_without_new_times_the_fleet_freezes():
    floor = LateFloor()
    floor.stand()
    floor.take(floor.fleet.take_times(floor.fleet.late(), {}, DURATION, floor.now))
    assert floor.commands[-1].phase == FREEZE


def test_new_times_that_come_after_a_freeze_are_not_told():
    floor = LateFloor()
    floor.stand()
    late = floor.fleet.late()
    floor.report("R2", BRAKING, fault=DRIVER_ERROR)
    assert floor.fleet.take_times(late, {"R1": new_times()}, DURATION, floor.now) is None
    assert floor.fleet.revision == 0


def test_a_second_late_robot_meanwhile_freezes_the_fleet():
    floor = LateFloor()
    floor.stand("R1")
    floor.stand("R2")
    assert floor.commands[-1].phase == FREEZE


def test_a_late_robot_whose_link_is_gone_is_lost_as_any_other():
    floor = LateFloor()
    floor.stand("R1")
    floor.take(floor.fleet.hear(keys.alive("hall", "R1"), LINK_GONE, floor.now))
    assert floor.commands[-1].phase == FREEZE
    assert floor.fleet.members["R1"].lost


def test_one_that_is_late_again_on_the_same_path_freezes_the_fleet_but_another_may_be_late():
    floor = LateFloor()
    for revision, robot in enumerate(("R1", "R2"), start=1):
        floor.stand(robot)
        late = floor.fleet.late()
        floor.fleet.take_times(late, {robot: new_times(revision)}, DURATION, floor.now)
        floor.report(robot, MOVING, fault=NO_FAULT)
        floor.pace(robot, revision)
        floor.pass_time(3)
        assert floor.fleet.phase == GO
    floor.stand("R1")
    assert floor.commands[-1].phase == FREEZE


def test_what_a_robot_said_before_it_got_the_new_times_is_no_new_delay():
    floor = LateFloor()
    floor.stand()
    floor.fleet.take_times(floor.fleet.late(), {"R1": new_times()}, DURATION, floor.now)
    floor.report("R1", FROZEN, fault=LATE)
    floor.pace("R1", 0, 1)
    floor.tick()
    assert floor.fleet.phase == GO
    assert floor.fleet.late() is None


@pytest.mark.parametrize("stood_us", [0, 2**53])
def test_a_forged_pace_of_a_robot_that_moves_changes_nothing(stood_us):
    floor = LateFloor()
    floor.pace("R2", 0, stood_us)
    floor.pass_time(5)
    assert (floor.fleet.phase, floor.fleet.late()) == (GO, None)


def test_a_late_robot_that_says_to_stand_where_its_plan_has_yet_to_come_is_not_believed():
    floor = LateFloor()
    floor.report("R1", FROZEN, fault=LATE)
    floor.pace("R1", 0, 2**53)
    assert floor.fleet.late() is None
    floor.pass_time(10, moving=("R2", "R3"))
    assert floor.fleet.phase == FREEZE


def test_another_fault_of_the_late_robot_is_not_borne():
    floor = LateFloor()
    floor.stand()
    floor.report("R1", FROZEN, fault=OFF_PATH)
    assert floor.commands[-1].phase == FREEZE


def test_a_robot_that_has_its_new_times_and_stands_again_while_others_lack_theirs_is_not_borne():
    floor = LateFloor()
    floor.stand()
    late = floor.fleet.late()
    floor.fleet.take_times(late, {"R1": new_times(), "R2": new_times()}, DURATION, floor.now)
    floor.report("R1", MOVING)
    floor.pace("R1", 1)
    floor.report("R1", FROZEN, fault=LATE)
    assert floor.commands[-1].phase == FREEZE


def test_a_robot_that_earlier_new_times_did_not_concern_may_be_late_too():
    floor = LateFloor()
    floor.stand("R1")
    floor.fleet.take_times(floor.fleet.late(), {"R1": new_times()}, DURATION, floor.now)
    floor.report("R1", MOVING)
    floor.pace("R1", 1)
    floor.pass_time(3)
    floor.report("R3", FROZEN, fault=LATE)
    floor.pace("R3", 0, (floor.now - floor.fleet.times.start_ns) // 1000 - 300_000)
    assert floor.fleet.late().robot == "R3"


def test_a_delay_that_is_made_good_is_no_failure_of_the_epoch():
    floor = LateFloor()
    floor.stand()
    floor.fleet.take_times(floor.fleet.late(), {"R1": new_times()}, DURATION, floor.now)
    floor.report("R1", MOVING)
    floor.pace("R1", 1)
    floor.pass_time(20)
    assert (floor.fleet.phase, floor.fleet.members["R1"].struck) == (GO, set())
    floor.report("R1", BRAKING, fault=LATE)
    floor.report("R1", FROZEN, fault=OFF_PATH)
    assert (floor.fleet.phase, floor.fleet.members["R1"].struck) == (FREEZE, {1})


def test_a_delay_that_lasts_too_long_is_one_failure_of_the_epoch():
    floor = LateFloor()
    floor.stand()
    while floor.fleet.phase == GO:
        floor.pass_time(moving=("R2", "R3"))
        floor.report("R1", FROZEN, fault=LATE)
    assert floor.fleet.members["R1"].struck == {1}


def test_a_late_robot_without_new_times_has_failed_the_epoch():
    floor = LateFloor()
    floor.stand()
    floor.fleet.take_times(floor.fleet.late(), {}, DURATION, floor.now)
    assert (floor.fleet.phase, floor.fleet.members["R1"].struck) == (FREEZE, {1})
    assert floor.said[-1] == "R1 is late, and there are no new times"
