"""What a robot hears of all that arrives between two ticks."""

import pytest

from protocol import keys
from protocol.codec import encode
from protocol.messages import MAX_MESSAGE_BYTES, PROTOCOL_VERSION, Clock, Command, Hello, Refusal
from protocol.phases import FREEZE, GO, HOLD
from robot_agent.inbox import Inbox
from tests.robot_agent.test_service import plan_message

HALL = "hall"


def a_command(sequence, boot=7, term=1, phase=HOLD):
    return Command(boot, term, sequence, 1, phase, 0, 0)


def put(inbox, key, message):
    inbox.put(key, encode(message), None)


def heard(inbox):
    return [one.message for one in iter(inbox.take, None)]


def test_messages_are_heard_in_the_order_in_which_they_came():
    inbox = Inbox("R1")
    said = [a_command(1), plan_message(), a_command(2), Clock(5, 1, 2, 3), a_command(3)]
    for message in said:
        kind = {"Command": keys.command(HALL), "Plan": keys.plan(HALL, "R1")}
        put(inbox, kind.get(type(message).__name__, keys.clock(HALL, "R1")), message)
    assert heard(inbox) == said


@pytest.mark.parametrize(
    ("key", "payload"),
    [
        (keys.command(HALL), b"junk"),
        (keys.plan(HALL, "R1"), bytes(MAX_MESSAGE_BYTES + 1)),
        (keys.plan(HALL, "R1"), encode(plan_message(robot="R2"))),
        (keys.plan(HALL, "R2"), encode(plan_message(robot="R2"))),
        (keys.plan(HALL, "R2"), encode(plan_message())),
        ("splinefleet/hall/plan/*", encode(plan_message())),
        ("splinefleet/**", encode(a_command(1))),
        (keys.clock(HALL, "R1"), encode(a_command(1))),
        (keys.hello(HALL, "R1"), encode(Hello(PROTOCOL_VERSION, 5))),
        (keys.clock(HALL, "R2"), encode(Clock(5, 1, 2, 3))),
    ],
)
def test_what_is_not_for_this_robot_or_cannot_be_read_is_dropped_and_counted(key, payload):
    inbox = Inbox("R1")
    inbox.put(key, payload, None)
    assert (heard(inbox), inbox.bad) == ([], 1)


def test_a_flood_of_garbage_and_of_other_messages_pushes_no_command_out():
    inbox = Inbox("R1")
    put(inbox, keys.command(HALL), a_command(9, phase=FREEZE))
    for number in range(5_000):
        inbox.put(keys.command(HALL), b"junk", None)
        put(inbox, keys.plan(HALL, "R1"), plan_message())
        put(inbox, keys.clock(HALL, "R1"), Clock(5, number, 2, 3))
        put(inbox, keys.plan(HALL, "R1"), Refusal(number, "no"))
    found = heard(inbox)
    assert a_command(9, phase=FREEZE) in found
    assert len(found) < 50
    assert (inbox.bad, inbox.dropped) == (5_000, 15_000 + 1 - len(found))


def test_of_a_flood_of_commands_the_newest_is_heard():
    inbox = Inbox("R1")
    for sequence in range(5_000):
        put(inbox, keys.command(HALL), a_command(sequence, phase=GO))
    assert heard(inbox)[-1] == a_command(4_999, phase=GO)


def test_a_command_put_on_the_wire_again_is_not_heard_again():
    inbox = Inbox("R1")
    for sequence in (5, 5, 3, 4, 6, 1):
        put(inbox, keys.command(HALL), a_command(sequence))
    assert [command.sequence for command in heard(inbox)] == [5, 6]
    for sequence in range(7):
        put(inbox, keys.command(HALL), a_command(sequence))
    assert heard(inbox) == []


@pytest.mark.parametrize(("boot", "term"), [(8, 1), (6, 1), (7, 2), (7, 0)])
def test_sequences_count_anew_for_another_boot_or_term(boot, term):
    """Who is obeyed is not for the inbox to say."""
    inbox = Inbox("R1")
    said = [a_command(9), a_command(1, boot, term), a_command(2, boot, term)]
    for command in said:
        put(inbox, keys.command(HALL), command)
    assert heard(inbox) == said
