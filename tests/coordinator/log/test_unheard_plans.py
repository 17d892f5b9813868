"""Which plans a listener has not heard, by what the robots say that they hold."""

import msgspec
import pytest

from coordinator.log.unheard_plans import UnheardPlans
from protocol.messages import Command, Refusal, Report
from protocol.phases import GO, HOLD, MOVING
from tests.protocol.test_wire_format import a_plan


def plan(epoch, robot):
    return msgspec.structs.replace(a_plan(), epoch=epoch, boot=5, robot=robot)


def report(epoch):
    return Report(7, 1, epoch, MOVING)


@pytest.fixture
def unheard():
    """What is known of an epoch 2 in which R1 was heard to get its plan."""
    known = UnheardPlans()
    known.take(Command(5, 1, 1, 2, GO, 0, 0), "")
    known.take(plan(2, "R1"), "R1")
    known.take(report(2), "R1")
    return known


def test_nothing_is_missing_as_long_as_every_plan_that_is_held_was_heard(unheard):
    assert unheard.robots == set()
    assert not unheard.asks(100.0)


def test_a_robot_that_holds_a_plan_which_was_not_heard_is_missing_until_it_is(unheard):
    unheard.take(report(2), "R2")
    assert unheard.robots == {"R2"}
    assert unheard.is_news(plan(2, "R2"), "R2")
    unheard.take(plan(2, "R2"), "R2")
    assert unheard.robots == set()
    assert not unheard.is_news(plan(2, "R2"), "R2")


def test_a_robot_that_holds_an_earlier_plan_or_none_is_not_missing(unheard):
    unheard.take(report(1), "R2")
    unheard.take(report(0), "R3")
    assert unheard.robots == set()


def test_who_slept_through_an_epoch_lacks_the_next_plans_of_all_who_hold_them(unheard):
    unheard.take(Command(5, 1, 90, 3, HOLD, 0, 0), "")
    assert unheard.robots == set()
    unheard.take(report(3), "R1")
    unheard.take(report(3), "R2")
    assert unheard.robots == {"R1", "R2"}


def test_only_a_plan_of_a_later_epoch_is_news(unheard):
    assert not unheard.is_news(plan(1, "R1"), "R1")
    assert not unheard.is_news(plan(2, "R1"), "R1")
    assert unheard.is_news(plan(3, "R1"), "R1")
    assert not unheard.is_news(report(3), "R1")
    assert not unheard.is_news(Refusal(7, "no"), "R2")


def test_a_further_course_that_a_robot_drives_or_holds_and_that_was_not_heard_is_missing(unheard):
    def course(revision):
        return msgspec.structs.replace(plan(2, "R1"), revision=revision)

    def drives(revision, holds):
        return msgspec.structs.replace(report(2), revision=revision, holds=holds)

    unheard.take(drives(0, 1), "R1")
    assert unheard.robots == {"R1"}
    assert unheard.is_news(course(1), "R1")
    unheard.take(course(1), "R1")
    assert unheard.robots == set()
    assert not unheard.is_news(course(1), "R1")
    unheard.take(drives(2, 3), "R1")
    unheard.take(course(3), "R1")
    assert unheard.robots == {"R1"}
    assert unheard.is_news(course(2), "R1")
    unheard.take(course(2), "R1")
    assert unheard.robots == set()


def test_the_coordinator_is_asked_at_most_twice_a_second(unheard):
    unheard.take(report(2), "R2")
    asked = [time / 100.0 for time in range(200) if unheard.asks(time / 100.0)]
    assert asked == [0.0, 0.5, 1.0, 1.5]
