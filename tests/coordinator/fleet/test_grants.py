"""The authority that Commands state, by hand-made staircases and messages."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from coordinator.fleet.grants import Grants
from coordinator.fleet.sent_courses import Sent
from coordinator.fleet.standstills import LONG_MS, STUCK_MS
from coordinator.plan.staircases import Staircases
from coordinator.schedule.authority import EVER
from protocol.messages import MOST_HELD, Command, Report
from protocol.phases import DONE, GO, MOVING
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS, MILLISECOND
from tests.coordinator.fleet.fleet_floor import NAMES, Floor

HEADROOM = 1_000
TAU = 500


def staircases(*pairs):
    """Staircases of one knot each: (ahead, behind, from when [ms], need [ms])."""
    pairs = sorted(pairs, key=lambda pair: (pair[1], pair[0]))
    ahead, behind, at, need = np.array(pairs, np.int64).reshape(-1, 4).T
    first = np.arange(len(pairs) + 1)
    return Staircases(TAU, ahead, behind, first, at.astype(np.int32), need.astype(np.int32))


def report(stamp_ms, late=0, sequence=1):
    return Report(1, sequence, 1, MOVING, stamp_ms=stamp_ms, late=late)


FAR = 10**9


def state(grants, now_ms):
    """What one Command states: up to when all may drive, and who has less."""
    (stated,) = grants.grant(now_ms, FAR)
    return now_ms + stated.headroom_ms, stated.held


def test_robots_that_meet_nobody_get_the_headroom():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    assert state(grants, 2_000) == (3_000, ())


def test_a_robot_that_says_nothing_is_granted_no_more_than_the_slack_and_is_named():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    for now in range(0, 10_000, 100):
        stated = state(grants, now)
        grants.hear("R1", report(now), now)
    assert stated == (10_900, ((1, 3_000),))


def test_a_robot_that_was_taken_out_is_granted_nothing_more_if_it_is_there_after_all():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    state(grants, 2_000)
    grants.remove("R2")
    (stated,) = grants.grant(60_000, FAR)
    said = Command(1, 1, 9, 1, GO, 0, 60_000 * MILLISECOND, *stated)
    assert said.authority_of(1) == 0
    assert said.authority_of(0) > 0


def test_the_one_behind_is_held_until_the_one_ahead_says_that_it_has_passed():
    grants = Grants(staircases((0, 1, 4_000, 3_000)), ["R1", "R2"], HEADROOM)
    for now in range(0, 6_000, 100):
        state(grants, now)
        grants.hear("R2", report(now), now)
        grants.hear("R1", report(now, late=-(-max(now - 2_000, 0) // LATE_STEP_MS)), now)
    assert state(grants, 6_000)[1] == ((0, 5_000), (1, 3_999))
    assert [(one.robot, one.by) for one in grants.standstills.held()] == [("R2", "R1")]
    grants.hear("R1", report(6_000, late=2_950 // LATE_STEP_MS), 6_000)
    assert (1, 3_999) not in state(grants, 6_100)[1]


def test_a_robot_that_begins_a_course_that_was_withdrawn_still_holds_those_behind_it():
    """It is where the course before has it as well; the new one takes its place in the tables."""
    grants = Grants(staircases((0, 1, 4_000, 3_000)), ["R1", "R2"], HEADROOM)
    for now in range(0, 2_000, 100):
        state(grants, now)
        grants.hear("R2", report(now), now)
        grants.hear("R1", report(min(now, 1_000)), now)
    grants.of("R1").next = Sent(2, 5, revision=1, begin_ms=1_000, shared_ms=2_000)
    grants._rule.open(2, 1_000, 2_000)
    grants.give_up("R1")
    grants.hear("R1", msgspec.structs.replace(report(2_000, sequence=2), revision=1), 2_000)
    for now in range(2_000, 9_000, 100):
        stated = state(grants, now)
        grants.hear("R2", report(now), now)
    assert stated[1] == ((1, 3_999), (5, 0))
    assert (grants.of("R1").now.slot, grants.of("R1").free_slot) == (0, 2)
    assert grants.spans("R1") == [(1, 2_000, 2_000)]


def test_a_robot_that_was_given_up_is_granted_nothing_more_wherever_it_is_to_leave_its_course():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    state(grants, 0)
    assert grants.ends.halt("R1", 1_500) == 1_500
    grants.give_up("R1")
    assert grants.ends.halt("R1", 2_000) == 1_000
    for now in range(0, 3_000, 100):
        grants.hear("R1", report(now), now)
        stated = state(grants, now)
    assert (0, 1_000) in stated[1]


def test_a_robot_that_was_given_up_is_granted_nothing_more_whatever_is_closed_or_opened():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    state(grants, 0)
    grants.give_up("R1")
    for most_ms in (5_000, EVER):
        grants.ends.limit("R1", most_ms)
        grants.ends.go_on("R1")
        for now in range(0, 3_000, 100):
            grants.hear("R1", report(now), now)
            stated = state(grants, now)
        assert (0, 1_000) in stated[1]
    copy = Grants.of_plain(grants.plain())
    copy.ends.limit("R1", EVER)
    assert (0, 1_000) in state(copy, 3_000)[1]


@pytest.mark.parametrize(("most_ms", "is_stuck"), [(500, False), (50_000, True)])
def test_a_robot_that_stands_is_stuck_unless_it_may_drive_no_farther(most_ms, is_stuck):
    grants = Grants(staircases(), ["R1"], HEADROOM)
    grants.ends.limit("R1", most_ms)
    for now in range(0, 2 * STUCK_MS, 100):
        state(grants, now)
    assert (grants.stuck(now) == {"R1"}) is is_stuck


def test_a_robot_that_is_halted_stays_so_whatever_is_opened_until_it_may_go_on():
    grants = Grants(staircases(), ["R1"], HEADROOM)
    state(grants, 0)
    grants.ends.halt("R1")
    grants.ends.limit("R1", EVER)
    grants.hear("R1", report(1_000), 1_000)
    assert state(grants, 1_000) == (2_000, ((0, 1_000),))
    grants.ends.go_on("R1")
    assert state(grants, 1_000) == (2_000, ())


def test_reports_of_strangers_and_reports_without_a_stamp_say_nothing():
    grants = Grants(staircases(), ["R1"], HEADROOM)
    state(grants, 0)
    assert grants.hear("R9", report(5_000), 5_000)
    assert grants.hear("R1", report(None), 0)
    assert state(grants, 9_000) == (10_000, ((0, 3_000),))


@pytest.mark.parametrize("late", [0, 1])
def test_a_robot_that_claims_more_than_it_was_told_is_not_believed(late):
    grants = Grants(staircases(), ["R1"], HEADROOM)
    state(grants, 0)
    assert not grants.hear("R1", report(60_000, late), 0)
    assert grants.spans("R1") == [(0, 1_000, 1_000)]


def test_a_robot_at_its_goal_is_not_named_though_it_says_nothing_more():
    grants = Grants(staircases(), ["R1"], HEADROOM)
    state(grants, 0)
    grants.hear("R1", Report(1, 1, 1, DONE, stamp_ms=900), 900)
    assert state(grants, 90_000) == (91_000, ())


def test_a_robot_at_its_goal_lets_the_one_behind_it_by_though_it_says_nothing_more():
    grants = Grants(staircases((0, 1, 4_000, 2**31 - 1)), ["R1", "R2"], HEADROOM)
    for now in range(0, 9_000, 100):
        state(grants, now)
        grants.hear("R2", report(min(now, 3_900)), now)
        if now <= 2_000:
            grants.hear("R1", report(now), now)
    assert [one.by for one in grants.standstills.held()] == ["R1"]
    grants.hear("R1", Report(1, 1, 1, DONE, stamp_ms=2_000), 9_000)
    assert (1, 3_999) not in state(grants, 9_100)[1]
    assert grants.standstills.held() == []


def test_a_robot_that_waits_by_its_plan_has_driven_no_farther_though_its_wait_ends_later():
    line = Timeline([0.0, 1.0, 2.0], [0.5, 0.5, 0.5], [1.0], [60.0])
    course = SimpleNamespace(driven=SimpleNamespace(timeline=line))
    for courses, believed in (((), False), ((course,), True)):
        grants = Grants(staircases(), ["R1"], HEADROOM, courses)
        state(grants, 2_000)
        assert grants.hear("R1", report(65_000, late=100), 2_000) == believed
        assert not grants.hear("R1", report(65_000, late=20), 2_000)


def test_a_robot_that_claims_its_goal_before_it_was_let_drive_there_is_not_believed():
    line = Timeline([0.0, 5.0], [0.5, 0.5], [], [])
    course = SimpleNamespace(driven=SimpleNamespace(timeline=line), arrived=lambda _: course)
    stairs = staircases((0, 1, 4_000, 2**31 - 1))
    grants = Grants(stairs, ["R1", "R2"], HEADROOM, (course, course))
    state(grants, 0)
    assert not grants.hear("R1", Report(1, 1, 1, DONE, stamp_ms=60_000), 0)
    assert grants.spans("R1") == [(0, 0, 1_000)]
    for now in range(0, 9_500, 100):
        state(grants, now)
        grants.hear("R1", report(now), now)
    assert grants.hear("R1", Report(1, 1, 1, DONE, stamp_ms=10_000), 9_500)
    assert grants.spans("R1") == [(0, EVER, EVER)]


def test_a_robot_whose_progress_wavers_does_not_get_on():
    grants = Grants(staircases(), ["R1"], HEADROOM)
    for now in range(0, 15_000, 100):
        state(grants, now)
        late = -(-max(now - 2_000, 0) // LATE_STEP_MS)
        grants.hear("R1", report(now + now // 1_000, late), now)
    assert grants.stuck(15_000) == {"R1"}


def test_what_another_coordinator_may_have_told_bounds_where_a_robot_is_and_grants_nothing():
    grants = Grants(staircases(), ["R1"], HEADROOM)
    state(grants, 0)
    grants.lose_sight(7_000)
    assert grants.spans("R1") == [(0, 0, 7_000)]
    assert state(grants, 100) == (1_100, ())
    assert grants.hear("R1", report(6_000, late=2), 6_000)
    assert grants.spans("R1") == [(0, 5_900, 7_000)]


def test_another_coordinator_told_one_that_was_given_up_nothing_more_but_on_a_newer_course():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    state(grants, 0)
    grants.give_up("R1")
    grants.lose_sight(7_000)
    assert grants.spans("R1") == [(0, 0, 1_000)]
    assert grants.spans("R2") == [(0, 0, 7_000)]
    plan = SimpleNamespace(begin_ms=2_000, revision=1)
    course = SimpleNamespace(driven=SimpleNamespace(id="R1", plan=plan))
    assert grants.commit(grants.reserve(), course, [], staircases())
    grants.lose_sight(8_000)
    assert grants.spans("R1") == [(0, 0, 1_000), (1, 0, 8_000)]


@pytest.mark.parametrize(
    ("speed", "passed", "may_have_more"),
    [
        (0.5, 500, False),
        (0.5, 990, True),
        (0.5, 2_000, False),
        (1.5, 900, False),
        (1.5, 960, True),  # 60 mm: a lateness is stated in steps of 50 ms, and these are 75 mm.
        (1.5, 1_040, False),
    ],
)
def test_one_that_stands_where_its_known_authority_ends_seems_to_have_no_more(
    speed, passed, may_have_more
):
    """R1 was told 1,000 ms, as far as is known."""
    line = Timeline([0.0, 10.0 * speed], [speed, speed], [], [])
    course = SimpleNamespace(driven=SimpleNamespace(timeline=line))
    grants = Grants(staircases(), ["R1"], HEADROOM, (course,))
    state(grants, 0)
    assert grants.ends.is_end_known("R1")
    assert not grants.ends.may_have_more("R1")
    grants.lose_sight(7_000)
    grants.hear("R1", report(passed), passed)
    assert grants.ends.may_have_more("R1") == grants.ends.is_end_known("R1") == may_have_more
    assert grants.ends.halt("R1") == (1_000 if may_have_more else 7_000)


def test_one_that_has_passed_all_that_it_may_have_been_told_has_no_more():
    line = Timeline([0.0, 1.0, 2.0], [0.5, 0.5, 0.5], [1.0], [9.0])
    course = SimpleNamespace(driven=SimpleNamespace(timeline=line))
    grants = Grants(staircases(), ["R1"], HEADROOM, (course,))
    state(grants, 0)
    grants.lose_sight(7_000)
    assert not grants.ends.is_end_known("R1")
    assert grants.hear("R1", report(7_000), 7_000)
    assert grants.ends.is_end_known("R1")
    assert not grants.ends.may_have_more("R1")
    assert grants.ends.halt("R1") == 7_000


def test_one_that_is_held_for_long_stands_where_it_is_whatever_it_was_told():
    """R2 may have been told up to 7 s by another coordinator, and stands at 2 s behind R1."""
    line = Timeline([0.0, 5.0], [0.5, 0.5], [], [])
    course = SimpleNamespace(driven=SimpleNamespace(timeline=line))
    grants = Grants(staircases((0, 1, 1_000, 500)), ["R1", "R2"], HEADROOM, (course, course))
    state(grants, 0)
    grants.lose_sight(7_000)
    assert grants.hear("R2", report(2_000), 2_000)
    for now in range(2_000, 2_000 + LONG_MS, 100):
        state(grants, now)
        assert not grants.ends.is_end_known("R2")
    state(grants, 2_000 + LONG_MS)
    assert grants.ends.is_end_known("R2")
    assert grants.ends.may_have_more("R2")
    assert grants.ends.halt("R2") == 2_000


@pytest.mark.parametrize(("need_ms", "fits"), [(300, True), (900, False)])
def test_a_course_is_refused_for_what_was_told_against_it_and_for_nothing_else(need_ms, fits):
    """After a resume, R2 may have been told more than R1 lets it: that is none of R3's business."""
    grants = Grants(staircases((0, 1, 1_000, 500)), ["R1", "R2", "R3"], HEADROOM)
    state(grants, 0)
    grants.lose_sight(7_000)
    grants.hear("R1", report(400), 400)
    plan = SimpleNamespace(begin_ms=9_000, revision=1)
    course, near = (
        SimpleNamespace(driven=SimpleNamespace(id=name, plan=plan)) for name in ("R3", "R1")
    )
    grants.of("R1").now.course = near
    number = grants.reserve()
    against = staircases((1, 0, 8_000, need_ms))
    assert grants.commit(number, course, [near], against) == fits


@pytest.mark.parametrize("more", [0, 1, 40, 250])
def test_those_that_one_command_cannot_name_are_named_in_several(more):
    """Robots fall silent one after another; every Command alone may be the only one heard."""
    count = MOST_HELD + more
    names = [f"R{number}" for number in range(count + 5)]
    grants, told = Grants(staircases(), names, HEADROOM), [0] * len(names)
    for now in range(0, 60_000, 100):
        sent = grants.grant(now, FAR)
        ranges = [(one.first, one.last) for one in sent]
        assert [first for first, _ in ranges] == [0, *(last + 1 for _, last in ranges[:-1])]
        assert ranges[-1][1] == len(names) - 1
        for one in sent:
            assert len(one.held) <= MOST_HELD
            stated = Command(1, 1, 1, 1, GO, 0, now * MILLISECOND, *one)
            for number in range(len(names)):
                told[number] = max(told[number], stated.authority_of(number) or 0)
        for number, name in enumerate(names):
            if number >= count or now <= 100 * number:
                grants.hear(name, report(now), now)
    assert len(sent) == -(-count // MOST_HELD)
    for number in range(len(names)):
        last = 100 * number if number < count else 59_900
        assert told[number] <= last + 2_000 + HEADROOM


def authorities(floor):
    sent = [one for one in floor.commands if one.phase == GO]
    return [(one.said_ns - one.start_ns) // MILLISECOND + one.headroom_ms for one in sent]


def a_floor(*pairs):
    floor = Floor()
    floor.fleet.grants = Grants(staircases(*pairs), NAMES, HEADROOM)
    return floor.go()


def test_commands_grant_authority_from_go_on_and_none_in_other_phases():
    floor = a_floor()
    for _ in range(3):
        floor.everybody(MOVING)
        floor.tick()
    assert authorities(floor) == [600, 700, 800, 900]
    floor.take(floor.fleet.stop(floor.now))
    others = [command for command in floor.commands if command.phase != GO]
    assert {command.headroom_ms for command in others} == {0}


def test_a_report_of_another_epoch_or_process_is_no_progress():
    floor = a_floor((0, 1, 300, 200))
    for boot, epoch in ((1, 2), (5, 1)):
        wrong = Report(boot, next(floor.sequence), epoch, MOVING, stamp_ms=900)
        floor.hear("splinefleet/hall/report/R1", wrong)
    for _ in range(3):
        floor.tick()
    assert (1, TAU - 1) in floor.commands[-1].held
    right = Report(1, next(floor.sequence), 1, MOVING, stamp_ms=250)
    floor.hear("splinefleet/hall/report/R1", right)
    floor.tick()
    assert floor.commands[-1].held == ()


def test_a_command_speaks_for_no_number_that_is_reserved_later_and_grants_reserved_ones_nothing():
    grants = Grants(staircases(), ["R1", "R2"], HEADROOM)
    (before,) = grants.grant(0, FAR)
    number = grants.reserve()
    assert before.last < number
    (stated,) = grants.grant(100, FAR)
    assert stated.first <= number <= stated.last
    assert (number, 0) in stated.held
    grants.release(number)
    assert grants.reserve() > number
