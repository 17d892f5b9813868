"""Who is in a fleet when, by what an operator and the coordinator say."""

import pytest

from coordinator.findings.attendance import Attendance, Stay
from protocol.messages import (
    CANCELLED,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    Join,
    OrderState,
)

JOIN = Join(9, "R9", (1.0, 2.0, 0.0), 0.25, 0.8)
WIDER = Join(9, "R9", (1.0, 2.0, 0.0), 0.5, 0.8)


def taken(*messages):
    present = Attendance(["R1"])
    for now_ns, message in enumerate(messages, start=1):
        present.take(message, now_ns)
    return present.stays


def test_a_robot_is_in_the_fleet_from_its_course_until_it_has_left():
    said = (
        JOIN,
        OrderState("join-R9", WAITING),
        OrderState("join-R9", UNDER_WAY, "R9"),
        OrderState("join-R9", ORDER_DONE, "R9"),
        OrderState("leave-R9", REFUSED),
        OrderState("leave-R9", ORDER_DONE),
        OrderState("leave-R9", ORDER_DONE),
    )
    assert taken(*said) == {"R1": [Stay()], "R9": [Stay(3, 6, JOIN)]}


def test_one_that_may_not_join_is_never_in_the_fleet_and_its_radius_is_forgotten():
    refused = (JOIN, OrderState("join-R9", REFUSED))
    assert taken(*refused) == {"R1": [Stay()]}
    assert taken(*refused, WIDER, OrderState("join-R9", UNDER_WAY))["R9"] == [Stay(4, None, WIDER)]


def test_what_a_second_operator_says_of_a_robot_that_joins_already_does_not_count():
    said = (JOIN, WIDER, OrderState("join-R9", UNDER_WAY), WIDER)
    assert taken(*said)["R9"] == [Stay(3, None, JOIN)]


def test_a_robot_whose_join_was_cancelled_was_never_there():
    said = (
        JOIN,
        OrderState("join-R9", UNDER_WAY),
        OrderState("join-R9", CANCELLED),
        OrderState("leave-R9", ORDER_DONE),
    )
    assert taken(*said) == {"R1": [Stay()]}


def test_a_robot_may_leave_and_a_cancelled_join_does_not_bring_it_back():
    said = (
        OrderState("leave-R1", ORDER_DONE),
        Join(9, "R1", (1.0, 2.0, 0.0), 0.25, 0.8),
        OrderState("join-R1", UNDER_WAY),
        OrderState("join-R1", CANCELLED),
    )
    assert taken(*said) == {"R1": [Stay(None, 1)]}


@pytest.mark.parametrize("name", ["order-leave-R1", "leave", "R1", "xleave-R1"])
def test_an_order_of_another_name_says_nothing_of_who_is_there(name):
    assert taken(OrderState(name, ORDER_DONE)) == {"R1": [Stay()]}
