"""What becomes of asking for a robot to be admitted."""

import pytest
from msgspec.structs import replace

from coordinator.fleet.admit_outcome import NOT_BACK, Asking
from protocol.messages import UNDER_WAY, WAITING, Command, OrderState, Plan, Refusal
from protocol.phases import FREEZE, GO, HOLD, OVER, STOP
from protocol.timing import SECOND

BOOT = 77


def command(phase, epoch):
    return Command(boot=1, term=1, sequence=1, epoch=epoch, phase=phase, start_ns=0, said_ns=0)


def plan(epoch):
    return Plan(epoch, 1, "R2", 0, 0, 0, 10**9, 20, 500, 10, 1, b"", b"", b"", b"", b"", b"")


def asked(*messages):
    asking = Asking("R2", BOOT)
    asking.hear(command(GO, 1))
    asking.asked()
    for message in messages:
        assert not asking.answer
        asking.hear(message)
    return asking


@pytest.mark.parametrize("phase", [HOLD, GO])
def test_a_robot_is_admitted_when_the_epoch_after_the_freeze_has_a_plan_for_it(phase):
    asking = asked(plan(1), command(GO, 1), command(FREEZE, 1), plan(2), command(phase, 2))
    assert asking.admitted
    assert asking.answer.startswith("epoch 2")
    late = asked(command(FREEZE, 1), command(HOLD, 2), plan(2), command(phase, 2))
    assert late.admitted


def test_a_course_that_began_before_is_only_said_again():
    asking = Asking("R2", BOOT)
    asking.hear(replace(command(GO, 1), said_ns=30 * SECOND))
    asking.asked()
    before, after = (replace(plan(1), revision=2, begin_ms=ms) for ms in (20_000, 31_000))
    asking.hear(before)
    assert not asking.answer
    asking.hear(after)
    assert (asking.admitted, asking.answer) == (True, "R2 goes on from where it stands")


def test_a_robot_without_a_part_in_two_epochs_after_freezes_is_not_admitted():
    first = (command(FREEZE, 1), command(HOLD, 2), command(GO, 2), command(GO, 2))
    asking = asked(plan(1), *first, command(FREEZE, 2), command(HOLD, 3), command(GO, 3))
    assert not asking.admitted
    assert asking.answer == "epoch 3 goes on without R2; the coordinator's output says why"


def test_a_freeze_for_another_robot_decides_nothing():
    freeze = (command(FREEZE, 1), command(HOLD, 2), command(GO, 2))
    asking = asked(*freeze, command(FREEZE, 2), plan(3), command(HOLD, 3))
    assert asking.admitted


def test_a_fleet_that_is_over_admits_nobody():
    asking = asked(command(FREEZE, 1), command(OVER, 2))
    assert not asking.admitted
    assert asking.answer == "the fleet has ended without R2"


def test_who_asks_is_refused_by_an_answer_to_it_alone():
    assert not asked(Refusal(BOOT + 1, "not this one")).answer
    asking = asked(Refusal(BOOT, "R2 is under way"))
    assert not asking.admitted
    assert asking.answer == "R2 is under way"


def test_a_further_course_of_another_robot_admits_nobody():
    asking = Asking("R2", BOOT)
    asking.asked()
    further = replace(plan(1), revision=1)
    asking.hear(replace(further, robot="R1"))
    assert (asking.admitted, asking.answer) == (False, "")
    asking.hear(further)
    assert asking.admitted


def test_who_asks_in_vain_is_told_before_the_others_go_on():
    vain = Refusal(BOOT, "R2 was waited for")
    asking = asked(command(FREEZE, 1), command(HOLD, 2), vain)
    assert not asking.admitted
    assert asking.answer == "R2 was waited for"


def test_who_asks_for_a_robot_that_may_still_come_is_told_and_goes_on_asking():
    asking = asked(Refusal(BOOT, f"R2 {NOT_BACK}: start its program first"), plan(1))
    assert asking.waits_for == "R2 has not come back: start its program first"
    assert not asking.answer
    asking.hear(replace(plan(1), revision=2, begin_ms=31_000))
    assert asking.admitted


def test_who_asks_while_the_fleet_is_stopped_is_told_what_the_robot_waits_for():
    asking = asked(command(STOP, 1))
    assert asking.waits_for == "the fleet is stopped; R2 gets a course when it goes on"
    asking.hear(command(GO, 1))
    assert (asking.waits_for, asking.answer) == ("", "")


def test_a_robot_that_is_admitted_and_waits_for_others_is_told_with_them():
    waits = OrderState("way-1", WAITING, "R2", released_ms=5, reason="R2 waits for R3")
    asking = asked(waits, replace(waits, id="way-2", robot="R1"))
    assert (asking.answer, asking.waits_for) == ("", "way-1 waits: R2 waits for R3")
    asking.hear(replace(waits, state=UNDER_WAY, reason=""))
    assert (asking.answer, asking.waits_for) == ("", "")
