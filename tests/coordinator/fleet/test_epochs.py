"""The fleet core from one epoch to the next, by hand-made messages."""

from __future__ import annotations

import pytest

from coordinator.fleet.log_records import LINK_GONE, LINK_UP
from coordinator.fleet.member import STRIKES, Member
from coordinator.fleet.phases import (
    ARM_PATIENCE,
    LINKS_PATIENCE,
    RESUME_PATIENCE,
    RETURN_PATIENCE,
    SILENT_PATIENCE,
)
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import Command, Plan, Report, Rest
from protocol.phases import (
    ARMED,
    BRAKING,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    OFF_PATH,
    OVER,
)
from protocol.timing import COMMAND_PERIOD, REPORT_TIMEOUT, SECOND
from tests.coordinator.fleet.fleet_floor import (
    NAMES,
    PARTS,
    Floor,
    adopt,
    bounds,
    chain,
    frozen_but,
    grants,
    state_of,
)


def test_a_frozen_fleet_tells_where_its_robots_stand():
    floor = frozen_but("R2", finished=("R3",))
    told = {standing.robot: standing for standing in floor.fleet.standings()}
    assert (told["R1"].state, told["R1"].s, told["R1"].epoch) == ("rests", 1.25, 1)
    assert (told["R2"].state, told["R2"].s) == ("lost", None)
    assert told["R3"].state == "arrived"
    assert (told["R2"].since, told["R2"].until) == bounds(floor.fleet, "R2")


def test_the_next_epoch_holds_sends_its_plans_and_goes_when_its_robots_are_armed():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    assert (floor.commands[-1].phase, floor.commands[-1].epoch) == (HOLD, 2)
    for name in ("R1", "R3"):
        (sent,) = floor.report(name, IDLE, epoch=0)
        assert sent.payload == PARTS[name].plan
        floor.report(name, ARMED, epoch=2)
    floor.tick()
    assert (floor.commands[-1].phase, floor.commands[-1].epoch) == (GO, 2)
    for name in ("R1", "R3"):
        floor.report(name, DONE, epoch=2)
    floor.tick()
    assert floor.commands[-1].phase == FREEZE
    assert state_of(floor) == {"R1": "arrived", "R3": "arrived"}
    adopt(floor)
    assert floor.commands[-1].phase == OVER
    assert not floor.fleet.members.has_arrived


def test_a_robot_lost_while_a_later_epoch_arms_freezes_the_fleet_at_the_new_starts():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.report("R1", ARMED, epoch=2)
    floor.hear(keys.report("hall", "R3"), Report(1, next(floor.sequence), 0, IDLE))
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 1):
        floor.report("R1", ARMED, epoch=2)
        floor.tick()
    assert floor.commands[-1].phase == FREEZE
    assert floor.fleet.is_settled(floor.now + COMMAND_PERIOD)
    told = {standing.robot: standing for standing in floor.fleet.standings()}
    assert (told["R3"].state, told["R3"].s, told["R3"].epoch) == ("lost", 0.0, 2)
    assert (told["R1"].state, told["R1"].s, told["R1"].epoch) == ("rests", 0.0, 2)


def test_a_robot_that_does_not_arm_in_later_epochs_is_not_fit_after_some_tries():
    floor = frozen_but("R2")
    for epoch in range(2, 2 + STRIKES):
        floor.fleet.adopt(epoch, {n: PARTS[n] for n in ("R1", "R3")}, floor.now, grants())
        for _ in range(ARM_PATIENCE // COMMAND_PERIOD + 2):
            floor.report("R1", ARMED, epoch=epoch)
            floor.report("R3", IDLE, epoch=0, fault=OFF_PATH)
            floor.tick()
        assert floor.commands[-1].phase == FREEZE
    assert state_of(floor) == {"R1": "rests", "R3": "unfit"}


def test_a_robot_that_fails_by_itself_in_some_epochs_is_not_sent_again():
    floor = Floor().go()
    for epoch in range(1, 1 + STRIKES):
        floor.report("R2", BRAKING, epoch=epoch, fault=OFF_PATH)
        floor.fleet.leave_floor(floor.now)
        for name in NAMES:
            floor.report(name, FROZEN, epoch=epoch, s_m=0.5)
        if epoch < STRIKES:
            floor.fleet.adopt(epoch + 1, PARTS, floor.now, grants())
            floor.everybody(ARMED, epoch=epoch + 1)
            floor.tick()
            floor.everybody(MOVING, epoch=epoch + 1)
    assert state_of(floor) == {"R1": "rests", "R2": "unfit", "R3": "rests"}


def test_a_lost_robot_that_speaks_again_is_asked_where_it_rests_and_told_of():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.report("R2", FROZEN)
    floor.tick()
    assert floor.commands[-1].wanted == ("R2",)
    assert "R2" not in state_of(floor)
    floor.hear(keys.report("hall", "R2"), Report(1, next(floor.sequence), 0, IDLE, 0, Rest(3.5, 1)))
    floor.tick()
    assert floor.commands[-1].wanted == ()
    assert state_of(floor)["R2"] == "rests"


def test_a_robot_whose_link_is_gone_is_lost_at_once_under_way_but_not_while_the_fleet_gathers():
    floor = Floor()
    floor.hello("R1")
    floor.fleet.hear(keys.alive("hall", "R1"), LINK_GONE, floor.now)
    assert not floor.fleet.members["R1"].lost
    floor = Floor().go()
    floor.fleet.hear(keys.alive("hall", "R2"), LINK_GONE, floor.now)
    assert floor.fleet.phase == GO
    assert floor.fleet.members["R2"].lost
    assert floor.fleet.hear(keys.alive("hall", "R3"), LINK_UP, floor.now) == []


@pytest.mark.parametrize(
    ("boot", "term", "gives_way"),
    [(99, 1, True), (5, 1, False), (5, 2, True), (99, 0, False), (77, 5, False)],
)
def test_of_two_coordinators_of_a_run_the_higher_term_then_boot_id_wins(boot, term, gives_way):
    floor = Floor().go()
    command = encode(Command(boot, term, 1, 1, GO, 0, 0, run=77))
    floor.fleet.hear(keys.command("hall"), command, floor.now)
    assert floor.fleet.superseded == gives_way
    assert ("another coordinator" in floor.fleet.incidents[-1].text) == gives_way


@pytest.mark.parametrize("term", [0, 1, 9])
@pytest.mark.parametrize(("phase", "boot"), [(HOLD, 99), (HOLD, 5), (GO, 99), (GO, 5)])
def test_a_coordinator_under_way_gives_way_to_no_other_run(term, phase, boot):
    command = encode(Command(boot, term, 1, 1, phase, 0, 0, run=boot))
    leads, begins = Floor().go(), Floor()
    for floor in (leads, begins):
        floor.fleet.hear(keys.command("hall"), command, floor.now)
    assert not leads.fleet.superseded
    assert begins.fleet.superseded == ((term, boot) > (1, 77))


def test_no_plan_goes_to_a_robot_that_has_no_part():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    sent = floor.hello("R2")
    assert not any(isinstance(decode("plan", o.payload), Plan) for o in sent)
    assert all(PARTS["R2"].plan != o.payload for o in sent)


def test_where_a_robot_rested_in_an_earlier_epoch_says_nothing_once_it_was_sent_on():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    late = Report(1, next(floor.sequence), 0, IDLE, 0, Rest(1.25, 1))
    floor.hear(keys.report("hall", "R1"), late)
    for name in ("R1", "R3"):
        floor.report(name, ARMED, epoch=2)
    floor.tick()
    assert floor.commands[-1].phase == GO
    floor.hear(keys.report("hall", "R1"), Report(1, next(floor.sequence), 2, MOVING, 0, Rest(1, 1)))
    floor.report("R3", BRAKING, epoch=2, fault=OFF_PATH)
    floor.fleet.leave_floor(floor.now)
    floor.tick()
    assert not floor.fleet.is_settled(floor.now)
    floor.report("R1", FROZEN, epoch=2, s_m=0.75)
    floor.report("R3", FROZEN, epoch=2, s_m=0.5)
    told = {standing.robot: standing for standing in floor.fleet.standings()}
    assert (told["R1"].epoch, told["R1"].s) == (2, 0.75)


def test_a_robot_lost_while_it_brakes_may_stand_where_it_last_kept_to_its_plan():
    floor = Floor().go()
    for _ in range(10):
        floor.tick()
        floor.everybody(MOVING)
    since, until = bounds(floor.fleet, "R2")
    assert 0.0 < since < until
    floor.report("R2", BRAKING, fault=OFF_PATH)
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
        floor.report("R1", MOVING)
        floor.report("R3", MOVING)
        floor.tick()
    floor.fleet.leave_floor(floor.now)
    told = {standing.robot: standing for standing in floor.fleet.standings()}
    assert told["R2"].state == "lost"
    assert told["R2"].since == since
    assert until <= told["R2"].until <= since + 3.5


@pytest.mark.parametrize("epoch", [0, 2, 4_000_000_000])
def test_a_place_on_a_path_that_is_not_known_is_not_believed(epoch):
    floor = Floor().go()
    forged = Report(1, next(floor.sequence), 1, FROZEN, 0, Rest(1.0, epoch))
    assert floor.hear(keys.report("hall", "R1"), forged) == []
    assert floor.fleet.members["R1"].rest is None
    assert floor.fleet.bad_messages == 1


def test_a_fault_without_a_name_is_told_by_its_number():
    floor = Floor().go()
    floor.report("R2", BRAKING, fault=7)
    assert any("fault 7" in incident.text for incident in floor.fleet.incidents)


def test_a_coordinator_that_takes_over_goes_on_in_the_same_epoch_with_a_higher_term():
    floor = Floor().go()
    floor.tick()
    before = floor.commands[-1]
    floor.fleet.superseded = True
    for boot, term in ((78, 2), (79, 3)):
        floor.fleet.take_over(boot, floor.now, floor.now)
        floor.tick()
        said = floor.commands[-1]
        assert (said.boot, said.term, said.epoch, said.phase) == (boot, term, 1, GO)
    assert not floor.fleet.superseded
    assert said.start_ns > before.start_ns


@pytest.mark.parametrize("phase", [MOVING, FROZEN])
def test_a_coordinator_that_took_over_ends_where_its_log_lacks_an_epoch(phase):
    floor = Floor().go()
    floor.fleet.take_over(78, floor.now, floor.now)
    floor.hear(keys.report("hall", "R1"), Report(1, 999, 5, phase))
    assert floor.fleet.superseded


def test_a_coordinator_that_took_over_ends_where_its_log_lacks_the_start():
    floor = Floor()
    for name in NAMES:
        floor.hello(name)
    floor.fleet.take_over(78, floor.now, floor.now)
    assert floor.fleet.phase == HOLD
    floor.report("R1", MOVING)
    assert floor.fleet.superseded


def test_a_coordinator_that_took_over_ends_where_a_robot_is_farther_than_its_log_allows():
    floor = Floor().go()
    floor.fleet.allowed_ms = 3_000
    floor.fleet.take_over(78, floor.now, floor.now)
    near = Report(1, 998, 1, MOVING, stamp_ms=3_000, late=1)
    floor.hear(keys.report("hall", "R1"), near)
    assert not floor.fleet.superseded
    far = Report(1, 999, 1, MOVING, stamp_ms=9_000, late=1)
    floor.hear(keys.report("hall", "R1"), far)
    assert floor.fleet.superseded


def test_nobody_waits_in_a_later_epoch_for_a_robot_that_died_while_the_coordinator_was_away():
    floor = Floor().go()
    floor.now += REPORT_TIMEOUT + 4 * COMMAND_PERIOD
    floor.tick(0)
    while not floor.fleet.members["R2"].lost:
        floor.tick()
        floor.report("R1", MOVING)
        floor.report("R3", MOVING)
    floor.fleet.leave_floor(floor.now)
    for name in ("R1", "R3"):
        floor.report(name, FROZEN, s_m=1.25)
    adopt(floor, "R1", "R3")
    for name in ("R1", "R3"):
        floor.report(name, ARMED, epoch=2)
    floor.tick()
    assert (floor.fleet.phase, floor.commands[-1].phase) == (GO, GO)


@pytest.mark.parametrize("phase", [FROZEN, ARMED])
def test_nobody_is_called_lost_who_had_no_time_to_be_heard_since_the_coordinator_was_away(phase):
    floor = frozen_but("R2")
    if phase == ARMED:
        adopt(floor, "R1", "R3")
    floor.now += 5 * SECOND
    floor.tick(0)
    floor.tick()
    assert not any(floor.fleet.members[robot].lost for robot in ("R1", "R3"))
    for robot in ("R1", "R3"):
        floor.report(robot, phase, epoch=1 if phase == FROZEN else 2)
    floor.tick()
    assert floor.commands[-1].phase == (FREEZE if phase == FROZEN else GO)
    for _ in range((RETURN_PATIENCE + REPORT_TIMEOUT) // COMMAND_PERIOD + 2):
        floor.tick()
    assert floor.fleet.members["R1"].lost


@pytest.mark.parametrize("away", [1, 20])
def test_links_that_a_coordinator_lost_by_hanging_are_not_counted_as_the_robots(away):
    floor = Floor()
    floor.go()
    floor.now += away * COMMAND_PERIOD
    floor.fleet.hear("splinefleet/hall/alive/R1", LINK_GONE, floor.now)
    assert floor.fleet.members["R1"].lost == (away == 1)
    floor.tick(0)
    floor.fleet.hear("splinefleet/hall/alive/R2", LINK_GONE, floor.now)
    assert floor.fleet.members["R2"].lost == (away == 1)
    away_news = [one.text for one in floor.fleet.incidents if one.kind == "away"]
    assert away_news == ([] if away == 1 else ["the coordinator was away for 2.0 s"])


def test_a_robot_armed_with_the_plan_of_another_epoch_does_not_let_the_fleet_set_out():
    floor = frozen_but("R2")
    adopt(floor, "R1", "R3")
    floor.report("R1", ARMED, epoch=2)
    floor.report("R3", ARMED, epoch=1)
    floor.tick()
    assert floor.commands[-1].phase == HOLD
    floor.report("R3", ARMED, epoch=2)
    floor.tick()
    assert floor.commands[-1].phase == GO


def taken_over():
    """Return a floor whose coordinator died while all drove, and another took over 20 s later."""
    floor = Floor().go()
    heard_ns = floor.now
    floor.now += 20 * SECOND
    floor.fleet.take_over(78, heard_ns, floor.now)
    return floor


def test_robots_have_time_to_be_heard_by_a_coordinator_that_took_over():
    floor = taken_over()
    floor.report("R1", MOVING)
    floor.tick()
    until = floor.now + RESUME_PATIENCE + REPORT_TIMEOUT
    while floor.now < until - COMMAND_PERIOD:
        floor.tick()
        assert not any(member.lost for member in floor.fleet.members.values())
    while floor.now < until + 2 * COMMAND_PERIOD:
        floor.tick()
    assert all(member.lost for member in floor.fleet.members.values())


def test_a_coordinator_that_took_over_and_hears_nobody_waits_for_links_and_then_ends():
    floor = taken_over()
    begun, ends = floor.now, LINKS_PATIENCE + RESUME_PATIENCE + REPORT_TIMEOUT + SILENT_PATIENCE
    while floor.fleet.phase == GO:
        floor.tick()
    assert abs(floor.now - begun - ends) <= 2 * COMMAND_PERIOD


def test_links_that_are_made_long_after_a_coordinator_took_over_let_the_fleet_go_on():
    floor = taken_over()
    for _ in range(30 * SECOND // COMMAND_PERIOD):
        floor.tick()
    for _ in range(20):
        floor.everybody(MOVING)
        floor.tick()
    for name in NAMES:
        floor.report(name, DONE)
    floor.tick()
    assert floor.fleet.phase == OVER
    assert all(member.finished and not member.lost for member in floor.fleet.members.values())


def nothing(floor, seconds):
    for _ in range(round(seconds * SECOND) // COMMAND_PERIOD):
        floor.tick()


def test_a_coordinator_that_took_over_on_a_computer_that_was_started_anew_waits_as_long():
    floor = Floor()
    floor.now = 100_000 * SECOND
    floor.go()
    floor.fleet.take_over(78, floor.now, floor.now)
    for _ in range(50):
        floor.everybody(MOVING)
        floor.tick()
    last_ns, floor.now = floor.now, 50 * SECOND
    floor.fleet.take_over(79, last_ns, floor.now)
    nothing(floor, 20.0)
    assert floor.fleet.phase == GO
    assert not any(member.struck for member in floor.fleet.members.values())


def test_who_is_not_heard_after_a_take_over_gets_no_strike_for_not_arming():
    floor = frozen_but()
    adopt(floor, *NAMES)
    last_ns, floor.now = floor.now, floor.now + 3 * SECOND
    floor.fleet.take_over(78, last_ns, floor.now)
    nothing(floor, 40.0)
    assert not any(member.struck for member in floor.fleet.members.values())
    assert floor.fleet.phase == HOLD
    for _ in range(2):
        floor.everybody(ARMED, epoch=2)
        floor.tick()
    assert floor.fleet.phase == GO


def test_waiting_for_links_excuses_no_standstill_of_a_fleet_that_does_not_drive():
    floor = Floor().go()
    floor.everybody(MOVING)
    floor.tick()
    floor.fleet.stop(floor.now)
    floor.everybody(FROZEN, s_m=0.3)
    floor.tick()
    before = floor.fleet.grants.standstills.got_on_latest_ms
    last_ns, floor.now = floor.now, floor.now + SECOND
    floor.fleet.take_over(78, last_ns, floor.now)
    nothing(floor, 50.0)
    assert floor.fleet.grants.standstills.got_on_latest_ms == before


def test_a_coordinator_that_took_over_hears_somebody_who_says_hello_or_has_no_part():
    started_anew, no_part = taken_over(), frozen_but("R1")
    adopt(no_part, "R2", "R3")
    for name in ("R2", "R3"):
        no_part.report(name, ARMED, epoch=2)
    no_part.tick()
    last_ns, no_part.now = no_part.now, no_part.now + SECOND
    no_part.fleet.take_over(78, last_ns, no_part.now)
    started_anew.tick()
    started_anew.hello("R1", boot=2)
    for _ in range(8 * SECOND // COMMAND_PERIOD):
        started_anew.tick()
        no_part.report("R1", IDLE, epoch=2)
        no_part.tick()
    assert all(started_anew.fleet.members[name].lost for name in NAMES)
    assert all(no_part.fleet.members[name].lost for name in ("R2", "R3"))


def test_stopping_and_going_on_does_not_prolong_the_wait_for_links():
    floor = taken_over()
    for _ in range(3):
        nothing(floor, 30.0)
        floor.fleet.stop(floor.now)
        floor.tick()
        floor.fleet.go_on(floor.now)
    assert all(member.lost for member in floor.fleet.members.values())


def test_a_robot_that_was_lost_just_before_a_take_over_is_not_given_up_at_once():
    floor = Floor(rule=chain).go()
    floor.everybody(MOVING)
    floor.tick()
    for _ in range(4 * SECOND // COMMAND_PERIOD):
        floor.report("R1", MOVING)
        floor.report("R2", MOVING)
        floor.tick()
    assert floor.fleet.members["R3"].lost
    last_ns, floor.now = floor.now, floor.now + 20 * SECOND
    floor.fleet.take_over(78, last_ns, floor.now)
    floor.tick()
    assert floor.fleet.grants.given_up == set()


def test_a_coordinator_that_takes_over_a_frozen_fleet_gives_nobody_up_at_once():
    floor = frozen_but("R2")
    heard_ns = floor.now
    floor.now += 60 * SECOND
    floor.fleet.take_over(78, heard_ns, floor.now)
    until = floor.now + RESUME_PATIENCE
    while floor.now < until - COMMAND_PERIOD:
        floor.tick()
        assert not floor.fleet.members["R1"].lost


def test_a_robot_that_lost_its_plan_before_it_set_out_is_sent_it_again():
    floor = Floor().go()
    floor.now += SECOND
    (sent,) = floor.report("R2", IDLE, epoch=0)
    assert sent.payload == floor.fleet.members["R2"].plan
    assert floor.report("R2", FROZEN, epoch=0) == []


@pytest.mark.parametrize("news", ["gone", "silent"])
def test_a_robot_without_a_part_that_dies_is_not_counted_on(news):
    floor = frozen_but("R2")
    adopt(floor, "R1")
    floor.report("R1", ARMED, epoch=2)
    floor.report("R3", FROZEN, s_m=1.25)
    floor.tick()
    if news == "gone":
        floor.fleet.hear(keys.alive("hall", "R3"), LINK_GONE, floor.now)
    for _ in range(REPORT_TIMEOUT // COMMAND_PERIOD + 2):
        floor.report("R1", MOVING, epoch=2)
        floor.tick()
    assert floor.fleet.phase == GO
    assert state_of(floor)["R3"] == "rests"
    floor.fleet.leave_floor(floor.now)
    floor.report("R1", FROZEN, epoch=2, s_m=0.5)
    floor.tick()
    floor.tick()
    assert floor.fleet.is_settled(floor.now)
    assert state_of(floor) == {"R1": "rests", "R3": "lost"}


def test_a_robot_at_the_end_of_a_course_of_an_earlier_epoch_has_not_finished_its_new_one():
    member = Member(id="R1", radius=0.2, speed=0.5, plan=b"", boot=7)
    member.take_part(b"", 0.5, 2)
    for epoch in (1, 2):
        assert not member.finished
        member.hear(Report(boot=7, sequence=epoch, epoch=epoch, phase=DONE, fault=0), SECOND)
        assert member.has_arrived == member.finished == member.has_driven(2, 0) == (epoch == 2)
    assert member.standing(2, [], SECOND).epoch == 2


def test_when_the_fleet_freezes_who_may_have_begun_its_next_course_has_to_say_where_it_is():
    floor = Floor().go()
    floor.report("R1", DONE)
    member = floor.fleet.members["R1"]
    member.take_course(b"next plan of R1", 1, floor.now)
    assert member.is_at_rest()
    floor.fleet.leave_floor(floor.now)
    assert not member.is_at_rest()
    floor.report("R1", DONE)
    assert member.is_at_rest()


def test_a_robot_that_is_pushed_off_its_goal_has_not_finished_any_more():
    member = Member(id="R1", radius=0.2, speed=0.5, plan=b"", boot=7)
    member.take_part(b"", 0.5, 1)
    for sequence, (phase, is_there) in enumerate([(DONE, True), (DONE, True), (BRAKING, False)], 1):
        member.hear(Report(boot=7, sequence=sequence, epoch=1, phase=phase, fault=0), SECOND)
        assert member.finished is is_there


def test_a_robot_has_arrived_when_it_first_says_so():
    member = Member(id="R1", radius=0.2, speed=0.5, plan=b"", boot=7)
    member.take_part(b"", 0.5, 1)
    for sequence in (1, 2):
        said = Report(boot=7, sequence=sequence, epoch=1, phase=DONE, fault=0)
        member.hear(said, sequence * SECOND)
        assert member.done_ns == SECOND
