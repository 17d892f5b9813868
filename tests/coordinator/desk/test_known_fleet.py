"""What the desk knows of a fleet from its messages, and what calls a person."""

import msgspec
import pytest

from coordinator.desk.known_fleet import KnownFleet
from coordinator.fleet.log_records import LINK_GONE
from coordinator.planning.planner import plan_fleet
from protocol import keys
from protocol.codec import encode
from protocol.messages import (
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    Block,
    Hello,
    OrderState,
    Unblock,
)
from protocol.phases import CLOCK_UNSURE, DONE, DRIVER_ERROR, FREEZE, FROZEN, IDLE, MOVING, OVER
from tests.coordinator.desk.fake_fleet import FLEET, a_command, a_report
from tests.scenarios import a_robot, a_scenario

CROSSED = [a_robot("R1", (1.0, 4.0), (9.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))]


def fleet_of(*heard, at=0.0, known=None):
    known = known or KnownFleet(FLEET, wall_s=1_000.0)
    for key, message in heard:
        known.hear(key, encode(message), at)
    return known


def report(robot, **fields):
    return keys.report(FLEET, robot), a_report(**fields)


def state(name, state, robot="R1", released=1, **fields):
    told = OrderState(name, state, robot, released_ms=released, **fields)
    return keys.orders(FLEET, name), told


COMMAND = (keys.command(FLEET), a_command())


def command_at(seconds, boot=1):
    """A Command that was said at this time of the coordinator's clock."""
    return keys.command(FLEET), a_command(said_ns=round(1e9 * seconds), boot=boot)


def test_a_robot_is_what_it_reported_last_with_its_orders_and_who_holds_it():
    known = fleet_of(
        COMMAND,
        report("R1", phase=MOVING, late=3),
        state("a", UNDER_WAY),
        state("b", WAITING),
        state("c", ORDER_DONE),
    )
    answer = known.answer(0.5, {"R1": ("R2", 3.5)})
    (robot,) = answer.robots
    assert (robot.phase, robot.late, robot.age, robot.is_heard) == ("moving", 0.15, 0.5, True)
    assert (robot.order, robot.next) == ("a", ["b"])
    assert (robot.held_by, robot.held_since) == ("R2", 3.5)
    assert (answer.phase, answer.is_heard, answer.alarms) == ("go", True, [])
    counts = {"waiting": 1, "under way": 1, "done": 1, "cancelled": 0, "refused": 0}
    assert answer.orders == counts


def test_of_two_orders_under_way_a_robot_does_the_one_with_the_earlier_arrival():
    known = fleet_of(
        report("R1", phase=MOVING),
        state("then", UNDER_WAY, planned_arrival_ms=9_000),
        state("now", UNDER_WAY, planned_arrival_ms=5_000),
        state("later", WAITING),
    )
    (robot,) = known.answer(0.0, {}).robots
    assert (robot.order, robot.next) == ("now", ["then", "later"])
    assert known.seen("R1", 0.0).order == "now"


def test_who_is_silent_for_a_second_is_not_heard_and_calls_a_person_until_it_is_heard_again():
    known = fleet_of(COMMAND, report("R1"))
    fleet_of(command_at(2.0), known=known, at=2.0)
    answer = known.answer(2.0, {})
    assert not answer.robots[0].is_heard
    assert [(one.id, one.robot, one.since) for one in answer.alarms] == [("lost-R1", "R1", 1_000.0)]
    assert known.alarms.acknowledge("lost-R1")
    assert known.answer(2.1, {}).alarms[0].is_acknowledged
    fleet_of(report("R1"), known=known, at=2.2)
    assert known.answer(2.2, {}).alarms == []


def test_who_loses_its_link_is_not_heard_from_then_on_until_it_reports():
    known = fleet_of(COMMAND, report("R1"))
    known.hear(keys.alive(FLEET, "R1"), LINK_GONE, 0.1)
    assert [one.id for one in known.answer(0.1, {}).alarms] == ["lost-R1"]
    fleet_of(report("R1"), known=known, at=0.2)
    assert known.answer(0.2, {}).alarms == []


@pytest.mark.parametrize(
    ("said", "boot", "is_heard"), [(0.9, 1, True), (1.0, 1, False), (0.0, 2, False)]
)
def test_how_long_a_robot_is_silent_is_counted_on_the_coordinators_clock(said, boot, is_heard):
    known = fleet_of(COMMAND, report("R1"))
    fleet_of(command_at(said, boot), known=known, at=5.0)
    answer = known.answer(5.0, {})
    assert answer.robots[0].is_heard == is_heard
    assert [one.id for one in answer.alarms] == ([] if is_heard else ["lost-R1"])
    assert known.seen("R1", 5.0).is_heard == is_heard


def test_while_no_coordinator_is_heard_that_alone_calls():
    known = fleet_of(COMMAND, report("R1"))
    assert [one.id for one in known.answer(5.0, {}).alarms] == ["coordinator"]


def test_a_coordinator_that_has_ended_its_mission_calls_nobody():
    known = fleet_of(COMMAND, report("R1"), (keys.command(FLEET), a_command(OVER)))
    assert known.answer(5.0, {}).alarms == []


@pytest.mark.parametrize(
    ("phase", "fault", "told"),
    [
        (FROZEN, DRIVER_ERROR, "R1 stands: driver error"),
        (MOVING, CLOCK_UNSURE, "R1: clock not certain"),
        (IDLE, CLOCK_UNSURE, None),
        (DONE, 0, None),
    ],
)
def test_a_fault_calls_but_not_a_clock_that_every_robot_sets_first(phase, fault, told):
    known = fleet_of(COMMAND, report("R1", phase=phase, fault=fault))
    alarms = known.answer(0.1, {}).alarms
    assert [one.text for one in alarms] == ([] if told is None else [told])


def test_a_refused_order_calls_until_somebody_has_seen_it():
    known = fleet_of(COMMAND, report("R1"))
    heard = (command_at(4.0), report("R1"), state("a", REFUSED, reason="no way"))
    fleet_of(*heard, state("leave-R7", REFUSED), known=known, at=4.0)
    fleet_of(state("a", REFUSED, reason="no way"), known=known, at=4.0)
    (alarm,) = known.answer(4.1, {}).alarms
    assert (alarm.order, alarm.text) == ("a", "order a is refused: no way")
    fleet_of(state("leave-R1", ORDER_DONE), known=known, at=4.2)
    assert known.alarms.acknowledge("refused-a")
    assert not known.alarms.acknowledge("refused-a")
    assert known.answer(4.3, {}).alarms == []


def test_an_order_that_was_refused_before_the_desk_began_calls_nobody():
    known = fleet_of(COMMAND, state("a", REFUSED, reason="no way"))
    assert known.answer(0.1, {}).alarms == []
    assert [one.state for one in known.summaries()] == ["refused"]


def test_an_order_that_never_was_is_not_listed():
    known = fleet_of(state("nosuch", REFUSED, released=None))
    assert known.summaries() == []


def test_a_robot_that_was_taken_out_stays_out_though_its_program_speaks():
    known = fleet_of(COMMAND, report("R1"), report("R2"), state("leave-R1", ORDER_DONE))
    fleet_of(report("R1"), known=known)
    assert [one.id for one in known.answer(0.1, {}).robots] == ["R2"]


def test_a_robot_that_was_taken_out_unheard_calls_a_person_while_it_is_heard():
    known = fleet_of(COMMAND, report("R1"), report("R2"))
    fleet_of(command_at(2.0), report("R2"), state("leave-R1", ORDER_DONE), known=known, at=2.0)
    assert known.answer(2.0, {}).alarms == []
    fleet_of(report("R1", phase=MOVING), known=known, at=2.1)
    (alarm,) = known.answer(2.1, {}).alarms
    assert (alarm.id, alarm.robot) == ("outside-R1", "R1")
    assert alarm.text == "R1 was taken out, but is heard: it may be on the floor"
    fleet_of(command_at(4.0), report("R2"), known=known, at=4.0)
    assert known.answer(4.0, {}).alarms == []


def test_a_robot_that_was_taken_out_while_heard_calls_a_person_if_it_is_heard_for_long():
    known = fleet_of(COMMAND, report("R1"), report("R2"), state("leave-R1", ORDER_DONE))
    for second, calls in ((1.0, []), (59.0, []), (61.0, ["outside-R1"])):
        fleet_of(command_at(second), report("R1"), report("R2"), known=known, at=second)
        assert [one.id for one in known.answer(second, {}).alarms] == calls
    fleet_of(command_at(64.0), report("R2"), known=known, at=64.0)
    assert known.answer(64.0, {}).alarms == []


def test_places_are_closed_and_open_again():
    block = Block(1, "wet", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    known = fleet_of((keys.blocks(FLEET, "wet"), block))
    assert known.answer(0.0, {}).blocks == ["wet"]
    fleet_of((keys.blocks(FLEET, "wet"), Unblock(1, "wet")), known=known)
    assert known.answer(0.0, {}).blocks == []


def test_bad_bytes_and_other_fleets_change_nothing():
    known = fleet_of(COMMAND)
    assert known.hear(keys.command(FLEET), b"\xff", 0.0) is None
    assert known.hear(keys.report("other", "R1"), encode(a_report()), 0.0) is None
    assert known.hear("elsewhere", b"", 0.0) is None
    assert (known.heard["bad"], known.answer(0.0, {}).robots) == (1, [])


def test_a_robot_that_is_lost_stands_between_where_it_was_heard_and_where_its_authority_ends():
    (driven, *_) = plan_fleet(a_scenario(CROSSED), effort=0).driven
    plan = driven.plan
    command = msgspec.structs.replace(a_command(), held=((plan.number, 2_000),))
    known = fleet_of((keys.plan(FLEET, plan.robot), plan), (keys.command(FLEET), command))
    fleet_of(report(plan.robot, phase=MOVING), known=known)
    later = msgspec.structs.replace(command, said_ns=2_000_000_000)
    fleet_of((keys.command(FLEET), later), known=known, at=2.0)
    (robot,) = known.answer(2.0, {}).robots
    arcs = [driven.timeline.s_at(time) for time in (1.0, 2.0)]
    for place, told in zip(
        driven.curve.at_arc(arcs), robot.stretch[:: len(robot.stretch) - 1], strict=True
    ):
        assert told == pytest.approx(tuple(place), abs=1e-3)
    (x, y), (u, v) = robot.stretch[0], robot.stretch[-1]
    (alarm,) = known.alarms.now()
    where = f"between ({x:.1f}, {y:.1f}) and ({u:.1f}, {v:.1f})"
    assert (
        alarm.text == f"{plan.robot} is not heard. By its course it stands, or will stop, {where}"
    )
    assert "It may not hear STOP: keep away until you see it stand" in alarm.todo


def test_a_robot_that_is_lost_at_its_goal_stands_there():
    (driven, *_) = plan_fleet(a_scenario(CROSSED), effort=0).driven
    plan, command = driven.plan, msgspec.structs.replace(a_command(), headroom_ms=2_000)
    known = fleet_of((keys.plan(FLEET, plan.robot), plan), (keys.command(FLEET), command))
    done = msgspec.structs.replace(a_report(phase=DONE), stamp_ms=None)
    later = msgspec.structs.replace(command, said_ns=100 * 10**9)
    fleet_of((keys.report(FLEET, plan.robot), done), known=known)
    fleet_of((keys.command(FLEET), later), known=known, at=100.0)
    x, y = driven.curve.at_arc([driven.timeline.s_at(100.0)])[0]
    (alarm,) = known.answer(100.0, {}).alarms
    assert alarm.text == f"{plan.robot} is not heard. By its course it stands at ({x:.1f}, {y:.1f})"


def test_a_program_that_reports_under_the_name_of_nobody_in_the_fleet_is_not_shown():
    plan = plan_fleet(a_scenario(CROSSED), effort=0).driven[0].plan
    known = fleet_of((keys.plan(FLEET, plan.robot), plan), command_at(1.0))
    fleet_of(report(plan.robot), report("stray"), known=known)
    fleet_of(command_at(60.0), at=60.0, known=known)
    answer = known.answer(60.0, {})
    assert [one.id for one in answer.robots] == [plan.robot]
    assert [one.id for one in answer.alarms] == [f"lost-{plan.robot}"]
    assert known.seen("stray", 60.0) is None


def test_a_robot_that_is_back_without_a_course_calls_until_it_has_one():
    known = fleet_of(COMMAND, report("R1", phase=IDLE))
    assert known.answer(0.0, {}).alarms == []
    known.hear(keys.alive(FLEET, "R1"), LINK_GONE, 0.1)
    known.answer(0.1, {})
    fleet_of(report("R1", phase=IDLE, fault=CLOCK_UNSURE), known=known, at=0.2)
    for at in (0.2, 0.3):
        assert [one.id for one in known.answer(at, {}).alarms] == ["back-R1"]
    fleet_of(report("R1", phase=MOVING), known=known, at=0.4)
    assert known.answer(0.4, {}).alarms == []


@pytest.mark.parametrize(
    "later", [{"epoch": 2, "said_ns": 5 * 10**9}, {"phase": FREEZE, "said_ns": 5 * 10**9}]
)
def test_nothing_but_a_go_of_its_epoch_lets_a_lost_robot_drive_on(later):
    (driven, *_) = plan_fleet(a_scenario(CROSSED), effort=0).driven
    plan, command = driven.plan, msgspec.structs.replace(a_command(), headroom_ms=2_000)
    known = fleet_of((keys.plan(FLEET, plan.robot), plan), (keys.command(FLEET), command))
    fleet_of(report(plan.robot, phase=MOVING), known=known)
    command = msgspec.structs.replace(command, **later)
    fleet_of((keys.command(FLEET), command), known=known, at=2.0)
    place = driven.curve.at_arc([driven.timeline.s_at(2.0)])[0]
    assert known.answer(2.0, {}).robots[0].stretch[-1] == pytest.approx(tuple(place), abs=1e-3)


def test_an_order_that_waits_for_long_although_its_robot_is_free_calls_a_person():
    known = fleet_of(COMMAND, report("R1"), state("a", WAITING, reason="R2 rests in the way"))
    for at in (30.0, 59.0):
        fleet_of(COMMAND, report("R1"), known=known, at=at)
        assert known.answer(at, {}).alarms == []
    fleet_of(COMMAND, report("R1"), known=known, at=61.0)
    (alarm,) = known.answer(61.0, {}).alarms
    assert alarm.text == "order a waits although R1 is free: R2 rests in the way"
    fleet_of(COMMAND, report("R1", phase=MOVING), state("b", UNDER_WAY), known=known, at=62.0)
    assert known.answer(62.0, {}).alarms == []


def test_a_log_that_fails_calls_a_person_until_the_coordinator_is_started_again():
    known = fleet_of(COMMAND, report("R1"))
    known.alarms.log_failed("no space left; no robot is sent on its way any more", 1_000.0)
    (alarm,) = known.answer(0.0, {}).alarms
    assert alarm.text.startswith("no space left")
    assert known.alarms.acknowledge("log")
    assert known.answer(0.1, {}).alarms[0].is_acknowledged


def test_an_order_that_is_put_off_is_known_and_one_that_does_not_exist_is_not():
    known = fleet_of(
        COMMAND,
        state("later", WAITING, "", released=None, reason="waits until 60 s after the first GO"),
        state("none", REFUSED, "", released=None, reason="there is no order none"),
    )
    assert [(one.id, one.state) for one in known.summaries()] == [("later", "waiting")]


def test_a_robot_that_is_back_calls_nobody_once_it_is_told_a_course():
    (driven, *_) = plan_fleet(a_scenario(CROSSED), effort=0).driven
    plan, robot = driven.plan, driven.plan.robot
    known = fleet_of(COMMAND, (keys.plan(FLEET, robot), plan), report(robot, phase=MOVING))
    known.hear(keys.alive(FLEET, robot), LINK_GONE, 0.1)
    known.answer(0.1, {})
    fleet_of(report(robot, phase=IDLE), known=known, at=0.2)
    assert [one.id for one in known.answer(0.2, {}).alarms] == [f"back-{robot}"]
    course = msgspec.structs.replace(plan, revision=plan.revision + 1)
    fleet_of((keys.plan(FLEET, robot), course), known=known, at=0.3)
    assert known.answer(0.3, {}).alarms == []


def test_a_robot_that_is_lost_often_calls_also_while_it_is_heard():
    known = fleet_of(COMMAND, report("R1", phase=MOVING))
    for at in (10.0, 20.0, 30.0):
        fleet_of(COMMAND, report("R1", phase=MOVING), known=known, at=at - 0.5)
        assert known.answer(at - 0.5, {}).alarms == []
        known.hear(keys.alive(FLEET, "R1"), LINK_GONE, at)
        assert [one.id for one in known.answer(at, {}).alarms] == ["lost-R1"]
        fleet_of(COMMAND, report("R1", phase=MOVING), known=known, at=at + 0.5)
    (alarm,) = known.answer(30.6, {}).alarms
    assert alarm.text == "R1 was not heard 3 times in ten minutes"
    fleet_of(COMMAND, report("R1", phase=MOVING), known=known, at=611.0)
    assert known.answer(611.0, {}).alarms == []


def test_a_desk_that_begins_late_misses_a_robot_of_which_nothing_is_heard():
    (driven, *_) = plan_fleet(a_scenario(CROSSED), effort=0).driven
    plan, command = driven.plan, msgspec.structs.replace(a_command(), headroom_ms=2_000)
    known = fleet_of((keys.plan(FLEET, plan.robot), plan), (keys.command(FLEET), command))
    later = msgspec.structs.replace(command, said_ns=6 * 10**9)
    fleet_of((keys.command(FLEET), later), known=known, at=4.0)
    assert known.answer(4.0, {}).alarms == []
    fleet_of((keys.command(FLEET), later), known=known, at=6.0)
    (alarm,) = known.answer(6.0, {}).alarms
    assert alarm.text.startswith(
        f"{plan.robot} is not heard. By its course it stands, or will stop"
    )
    fleet_of(report(plan.robot, phase=MOVING), known=known, at=6.1)
    assert known.answer(6.2, {}).alarms == []


@pytest.mark.parametrize(
    ("place", "where"),
    [((1_500, 2_000, 0), " at (1.5, 2.0)"), (None, "")],
)
def test_a_robot_that_was_back_before_the_desk_began_calls_with_where_it_stands(place, where):
    (driven, *_) = plan_fleet(a_scenario(CROSSED), effort=0).driven
    plan = driven.plan
    known = fleet_of((keys.plan(FLEET, plan.robot), plan), COMMAND)
    hello = (keys.hello(FLEET, plan.robot), Hello(9, 1, 0.2, place=place))
    back = msgspec.structs.replace(a_report(phase=IDLE), epoch=0)
    for at in (0.5, 1.2):
        assert known.answer(at, {}).alarms == []
        heard = (hello, (keys.report(FLEET, plan.robot), back), command_at(at))
        fleet_of(*heard, known=known, at=at)
    (alarm,) = known.answer(1.3, {}).alarms
    assert (alarm.id, alarm.text) == (
        f"back-{plan.robot}",
        f"{plan.robot} is back{where} and has no course",
    )
