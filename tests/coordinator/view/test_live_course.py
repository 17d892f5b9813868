"""A bystander's view of a fleet: made from the messages alone."""

from functools import cache
from pathlib import Path

import msgspec
import pytest

from coordinator.fleet.log_records import LINK_GONE
from coordinator.plan.wire import pack, packed
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.schedule.staircase_making import with_staircases
from coordinator.view.live_course import LiveCourse
from coordinator.view.scene_plan import scene_of_plan
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    ORDER_DONE,
    UNDER_WAY,
    WAITING,
    Clock,
    Command,
    Hello,
    OrderState,
    Report,
    Rest,
)
from protocol.phases import (
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    MOVING,
    OFF_PATH,
    OVER,
    STOP,
)
from protocol.timing import SECOND
from tests.coordinator.findings.test_log_proof import CROSS

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
FLEET = "paper-five"
ZERO = 1000 * SECOND
OURS = 50.0
"""Our clock [s] at the fleet's ZERO."""


@cache
def document():
    return plan_scenario(read_scenario(EXAMPLES / "paper_five_real.toml"), effort=0)


def tell_plans(course, t=-1.0):
    for robot in document().robots:
        said = Hello(version=1, boot=1, radius_m=robot.radius)
        course.hear(keys.hello(FLEET, robot.id), encode(said), OURS + t)
        assert course.hear(keys.plan(FLEET, robot.id), pack(document(), robot, 0), OURS + t)


def tell_command(course, t, phase, epoch=1, ours=None):
    """Tell a Command that was said at the fleet's time t; `ours`: when we hear it, t by default."""
    start, said = 0 if phase == HOLD else ZERO, ZERO + round(t * SECOND)
    message = encode(Command(1, 1, 1, epoch, phase, start, said, 600))
    return course.hear(keys.command(FLEET), message, OURS + (t if ours is None else ours))


def tell_time(course, t, ours):
    stamp = ZERO + round(t * SECOND)
    message = encode(Clock(1, 5, stamp, stamp))
    course.hear(keys.clock(FLEET, "R1"), message, OURS + ours)


def test_the_motions_are_those_of_the_plan_file():
    course = LiveCourse(None, None)
    tell_time(course, -2.0, -2.0)
    tell_plans(course)
    assert tell_command(course, -1.0, HOLD)
    assert tell_command(course, -0.5, GO)
    assert not tell_command(course, -0.4, GO)
    scene, wanted = course.scene(), scene_of_plan(document())
    assert scene.robots == wanted.robots
    (epoch,) = scene.epochs
    assert (epoch.start, epoch.frozen) == (0.0, None)
    for ride, true in zip(epoch.rides, wanted.epochs[0].rides, strict=True):
        assert (ride.path, ride.legs) == (true.path, true.legs)
        assert [(wait.s, wait.until) for wait in ride.waits] == [
            (pytest.approx(wait.s), pytest.approx(wait.until)) for wait in true.waits
        ]


def test_why_robots_wait_is_found_from_the_plans_once_the_epoch_has_begun():
    course = LiveCourse(None, None)
    tell_time(course, -2.0, -2.0)
    tell_plans(course)
    tell_command(course, -1.0, HOLD)
    assert {wait.lets for ride in course.scene().epochs[0].rides for wait in ride.waits} <= {-1}
    tell_command(course, -0.5, GO)
    (epoch,), (wanted,) = course.scene().epochs, scene_of_plan(document()).epochs
    told = [(ride.robot, wait.lets) for ride in epoch.rides for wait in ride.waits]
    assert told == [(ride.robot, wait.lets) for ride in wanted.rides for wait in ride.waits]
    assert any(lets >= 0 for _, lets in told)
    forced = [(zone.a, zone.b) for zone in epoch.zones if zone.forces]
    assert sorted(forced) == sorted((zone.a, zone.b) for zone in wanted.zones if zone.forces)


def test_a_freeze_is_seen_and_where_a_robot_rests():
    course = LiveCourse(FLEET, document())
    tell_time(course, 0.0, 0.0)
    tell_command(course, 0.0, GO)
    assert tell_command(course, 4.0, FREEZE)
    rest = encode(Report(1, 1, 1, FROZEN, 0, Rest(0.75, 1)))
    assert course.hear(keys.report(FLEET, "R1"), rest, OURS + 4.5)
    assert not course.hear(keys.report(FLEET, "R1"), rest, OURS + 4.7)
    fault = encode(Report(1, 2, 1, FROZEN, OFF_PATH, Rest(0.75, 1)))
    assert course.hear(keys.report(FLEET, "R1"), fault, OURS + 4.9)
    scene = course.scene()
    assert scene.epochs[0].frozen == pytest.approx(4.0, abs=1e-3)
    assert scene.epochs[0].rides[0].halt[3] == pytest.approx(0.75, abs=1e-3)
    told = [(mark.kind, mark.text) for mark in scene.marks]
    assert told == [
        ("go", "epoch 1: 5 robots go"),
        ("freeze", "all robots must freeze"),
        ("fault", "R1 off its path"),
    ]


def test_who_begins_to_listen_while_a_fleet_is_stopped_sees_where_its_robots_stand():
    """R1 was stopped at 4 s of its plan, 6 s before; its lateness grows."""
    course = LiveCourse(FLEET, document())
    tell_time(course, 10.0, 10.0)
    for t in (10.0, 10.5, 11.0):
        tell_command(course, t, STOP)
        said = Report(1, round(10 * t), 1, MOVING, 0, None, round(1000 * t), round(20 * (t - 4.0)))
        course.hear(keys.report(FLEET, "R1"), encode(said), OURS + t)
    assert course.clock(OURS + 11.0).now == pytest.approx(11.0, abs=1e-3)
    scene = course.scene()
    assert [(stop.since, stop.until) for stop in scene.epochs[0].stops] == [(10.0, None)]
    assert scene.epochs[0].started
    revision, knots = course.late().passed["R1"]
    assert revision == 0
    assert knots[-1] == (pytest.approx(11.0, abs=0.01), pytest.approx(4.0, abs=0.06))


def test_an_order_is_known_when_it_is_heard_whenever_the_first_go_was():
    """The plan was put off by 30 s before we listened: orders count from the first GO."""
    course = LiveCourse(FLEET, document())
    tell_time(course, 5.0, 5.0)
    tell_command(course, 5.0, GO)
    for state in (
        OrderState("a", UNDER_WAY, "R1", released_ms=34_000, accepted_ms=34_500),
        OrderState("b", WAITING, "R2", released_ms=35_100),
    ):
        course.hear(keys.orders(FLEET, state.id), encode(state), OURS + 5.0)
    now = course.clock(OURS + 5.0).now
    assert now == pytest.approx(34.5, abs=1e-3)
    orders = {one.id: one.steps for one in course.scene().orders}
    assert orders["a"][0][0] == pytest.approx(34.5, abs=1e-3)
    assert orders["b"][0][0] == pytest.approx(now, abs=1e-3)
    assert course.scene().epochs[0].start == pytest.approx(29.5, abs=1e-3)


def test_the_fleets_time_is_told_even_when_it_runs_faster():
    course = LiveCourse(FLEET, document())
    assert course.clock(OURS) is None
    tell_time(course, 0.0, 0.0)
    tell_command(course, 0.0, GO)
    tell_time(course, 40.0, 10.0)
    told = course.clock(OURS + 12.0)
    assert (told.now, told.speed) == (48.0, 4.0)


def test_how_old_the_last_word_is_is_told_with_how_long_robots_bear_silence():
    course = LiveCourse(FLEET, document())
    assert course.word(OURS) is None
    tell_command(course, 0.0, GO)
    tell_command(course, 4.0, GO)
    told = course.word(OURS + 4.7)
    assert (told.age, told.headroom, told.over) == (pytest.approx(0.7), 0.6, False)
    assert course.hear(keys.report(FLEET, "R1"), encode(Report(1, 1, 1, BRAKING, 1)), OURS + 5.0)
    assert course.word(OURS + 5.0).age == pytest.approx(1.0)
    tell_command(course, 6.0, OVER)
    assert course.word(OURS + 9.0).over


def test_a_robot_that_rests_without_a_freeze_is_shown_where_it_said():
    course = LiveCourse(FLEET, document())
    tell_time(course, 0.0, 0.0)
    tell_command(course, 0.0, GO)
    rest = encode(Report(1, 1, 1, FROZEN, 1, Rest(0.75, 1)))
    assert course.hear(keys.report(FLEET, "R1"), rest, OURS + 4.5)
    (epoch,) = course.scene().epochs
    assert epoch.frozen is None
    assert [ride.halt is not None for ride in epoch.rides] == [True, False, False, False, False]
    assert epoch.rides[0].halt[3] == pytest.approx(0.75, abs=1e-3)


def test_a_robot_that_learns_the_time_before_the_start_has_no_fault():
    course = LiveCourse(FLEET, document())
    tell_time(course, -2.0, -2.0)
    tell_command(course, -1.0, HOLD)
    learning = encode(Report(1, 1, 1, IDLE, CLOCK_UNSURE))
    assert not course.hear(keys.report(FLEET, "R1"), learning, OURS - 0.9)
    tell_command(course, 0.0, GO)
    unsure = encode(Report(1, 2, 1, BRAKING, CLOCK_UNSURE))
    assert course.hear(keys.report(FLEET, "R1"), unsure, OURS + 3.0)
    faults = [mark.text for mark in course.scene().marks if mark.kind == "fault"]
    assert faults == ["R1 clock not certain"]


def test_strangers_and_bad_bytes_change_nothing():
    course = LiveCourse(FLEET, None)
    assert not course.hear("other/thing", b"x", 0.0)
    assert not course.hear(keys.command("another"), encode(Command(1, 1, 1, 1, HOLD, 0, 0)), 0.0)
    for kind in (keys.plan, keys.report, keys.clock, keys.hello):
        assert not course.hear(kind(FLEET, "R1"), b"\xc1nonsense", 0.0)
    spoilt = bytearray(pack(document(), document().robots[0], 0))
    spoilt[-9] ^= 0xFF
    course.hear(keys.plan(FLEET, "R1"), bytes(spoilt), 0.0)
    assert course.scene().robots == []


def test_a_robot_not_heard_on_its_way_is_shown_where_it_was_last_heard_until_it_is_heard_again():
    course = LiveCourse(FLEET, document())
    tell_time(course, 0.0, 0.0)
    tell_command(course, 0.0, GO)
    moving = encode(Report(1, 1, 1, MOVING, stamp_ms=3_000))
    course.hear(keys.report(FLEET, "R1"), moving, OURS + 3.0)
    assert not tell_command(course, 3.5, GO)
    assert tell_command(course, 4.5, GO)
    ride = course.scene().epochs[0].rides[0]
    assert ride.unheard
    assert ride.halt[0] == pytest.approx(3.0, abs=1e-3)
    moving = encode(Report(1, 2, 1, MOVING, stamp_ms=5_000))
    course.hear(keys.report(FLEET, "R1"), moving, OURS + 5.0)
    assert tell_command(course, 5.1, GO)
    ride = course.scene().epochs[0].rides[0]
    assert (ride.unheard, ride.halt, ride.passed) == (False, None, [])


@pytest.mark.parametrize(("lost", "text"), [(True, "lost its link"), (False, "fell silent")])
def test_a_robot_that_is_lost_is_told_once_each_time_also_if_it_had_arrived(lost, text):
    course = LiveCourse(FLEET, document())
    tell_time(course, 0.0, 0.0)
    tell_command(course, 0.0, GO)
    for begin in (3.0, 6.0):
        for robot, phase in (("R1", MOVING), ("R2", DONE)):
            said = encode(Report(1, 1, 1, phase, stamp_ms=round(1000 * begin)))
            course.hear(keys.report(FLEET, robot), said, OURS + begin)
        for robot in ("R1", "R2") if lost else ():
            news = course.hear(keys.alive(FLEET, robot), LINK_GONE, OURS + begin + 0.5)
            assert news
            assert not course.hear(keys.alive(FLEET, robot), LINK_GONE, OURS + begin + 0.6)
        tell_command(course, begin + 1.5, GO)
        tell_command(course, begin + 1.6, GO)
    told = [mark.text for mark in course.scene().marks if mark.kind == "fault"]
    assert sorted(told) == [f"{robot} {text}" for robot in ("R1", *["R2"] * lost) for _ in range(2)]


def test_a_robot_that_comes_back_and_is_admitted_is_told_and_falls_silent_no_more():
    course = LiveCourse(FLEET, document())
    tell_time(course, 0.0, 0.0)
    tell_command(course, 0.0, GO)
    said = encode(Report(1, 1, 1, MOVING, stamp_ms=1_000))
    course.hear(keys.report(FLEET, "R1"), said, OURS + 1.0)
    course.hear(keys.alive(FLEET, "R1"), LINK_GONE, OURS + 1.5)
    for tenth in range(30, 60):
        idle = encode(Report(2, tenth, 1, IDLE))
        course.hear(keys.report(FLEET, "R1"), idle, OURS + 0.1 * tenth)
        tell_command(course, 0.1 * tenth, GO)
    (robot, *_) = document().robots
    plan = decode("plan", pack(document(), robot, 0))
    further = msgspec.structs.replace(plan, revision=plan.revision + 1, begin_ms=6_000)
    course.hear(keys.plan(FLEET, "R1"), encode(further), OURS + 6.0)
    told = [mark.text for mark in course.scene().marks if mark.text.startswith("R1")]
    assert told == ["R1 lost its link", "R1 is heard again", "R1 is admitted and has a course"]


def test_that_the_link_of_a_robot_ends_which_was_taken_out_is_no_news():
    course = LiveCourse(FLEET, document())
    tell_time(course, 0.0, 0.0)
    tell_command(course, 0.0, GO)
    said = encode(Report(1, 1, 1, DONE, stamp_ms=3_000))
    course.hear(keys.report(FLEET, "R2"), said, OURS + 3.0)
    left = OrderState("leave-R2", ORDER_DONE, "R2", released_ms=1)
    course.hear(keys.orders(FLEET, left.id), encode(left), OURS + 3.5)
    assert not course.hear(keys.alive(FLEET, "R2"), LINK_GONE, OURS + 4.0)


def test_no_robot_of_a_fleet_that_stands_still_for_a_while_falls_silent():
    course = LiveCourse(FLEET, document())
    for t in (0.0, 3.0):
        tell_time(course, t, t)
        tell_command(course, t, GO)
    course.hear(keys.report(FLEET, "R1"), encode(Report(1, 1, 1, MOVING, stamp_ms=3_000)), OURS + 3)
    tell_command(course, 3.1, GO, ours=6.0)
    assert [mark.text for mark in course.scene().marks if mark.kind == "fault"] == []


def test_how_late_robots_are_and_who_holds_whom_is_told_from_the_messages():
    document = plan_scenario(CROSS)
    stairs, names = with_staircases(packed(document)).staircases, ["R1", "R2"]
    behind, ahead = names[stairs.behind[0]], names[stairs.ahead[0]]
    waits, fleet = int(stairs.at[0]) - 1, document.scenario
    course = LiveCourse(fleet, None)
    for number, robot in enumerate(document.robots):
        course.hear(keys.hello(fleet, robot.id), encode(Hello(2, 1, robot.radius)), OURS)
        course.hear(keys.plan(fleet, robot.id), pack(document, robot, number), OURS)

    def tell(ms, progress, held=()):
        for robot, late in progress.items():
            said = Report(1, 1, 1, MOVING, stamp_ms=ms, late=late)
            course.hear(keys.report(fleet, robot), encode(said), OURS + ms / 1000.0)
        said = Command(1, 1, 1, 1, GO, ZERO, ZERO + ms * 10**6, 1_500, held)
        return course.hear(keys.command(fleet), encode(said), OURS + ms / 1000.0)

    course.hear(keys.clock(fleet, "R1"), encode(Clock(1, 5, ZERO, ZERO)), OURS)
    tell(0, {})
    assert course.late() is None
    tell(400, {ahead: 0, behind: 0})
    stuck = (names.index(behind), waits)
    tell(waits - 1_600, {ahead: 66, behind: 0})
    tell(waits + 400, {ahead: waits // 50, behind: 10}, (stuck,))
    assert tell(waits + 500, {ahead: waits // 50, behind: 12}, (stuck,))
    assert not tell(waits + 600, {behind: 14}, (stuck,))
    late = course.late()
    assert late.epoch == 1
    revision, knots = late.passed[ahead]
    assert revision == 0
    assert knots[-1] == pytest.approx(((waits + 500) / 1000.0, 0.5), abs=0.11)
    (held,) = course.scene().held
    assert (names[held.robot], names[held.by], held.until) == (behind, ahead, None)
    assert held.since == pytest.approx((waits + 500) / 1000.0, abs=1e-3)
    assert course.held_now() == {behind: (ahead, pytest.approx(held.since, abs=1e-3))}
    assert tell(waits + 900, {ahead: 0, behind: 0})
    (held,) = course.scene().held
    assert held.until == pytest.approx((waits + 900) / 1000.0, abs=1e-3)


def test_who_begins_to_listen_when_all_robots_have_had_orders_is_told_nothing_of_who_is_held():
    document = plan_scenario(CROSS)
    course, fleet = LiveCourse(document.scenario, None), document.scenario
    for number, robot in enumerate(document.robots):
        course.hear(keys.hello(fleet, robot.id), encode(Hello(2, 1, robot.radius)), OURS)
        later = pack(document, robot, number + 2, revision=1, begin_ms=500)
        course.hear(keys.plan(fleet, robot.id), later, OURS)
    late = Command(1, 1, 1, 1, GO, ZERO, ZERO + 2 * SECOND, 1_500, ((2, 900), (3, 900)))
    course.hear(keys.command(fleet), encode(late), OURS + 2.0)
    assert course.held_now() == {}
    assert len(course.scene().robots) == 2
