"""What robots and people act on is in the log, and with the system, before it is sent to them."""

import pytest

from protocol import keys
from protocol.messages import ORDER_DONE, Block, Cancel, Join
from protocol.messages import Order as Said
from sim.world.memory_transport import MemoryNetwork
from sim.world.virtual_service import VirtualJournal
from tests.sim.world.test_orders_in_time import (
    a_world,
    idle,
    long_hall,
    operator,
    queue_of_two,
    start_again,
    states,
)


@pytest.fixture
def too_early(monkeypatch):
    """Return what was sent first while a record of it was not yet with the system, as keys.

    Only the first sending of a payload counts; a later one says nothing new.
    """
    waiting, sent, early = set(), set(), []
    record, sync, send = VirtualJournal.record, VirtualJournal.sync, MemoryNetwork.send

    def recorded(journal, key, payload, *times):
        waiting.add((key, payload))
        record(journal, key, payload, *times)

    def synced(journal):
        waiting.clear()
        return sync(journal)

    def was_sent(network, sender, key, payload):
        _, kind, _ = keys.split(key)
        if kind in ("plan", "orders", "blocks") and (key, payload) not in sent:
            sent.add((key, payload))
            if (key, payload) in waiting:
                early.append(key)
        send(network, sender, key, payload)

    monkeypatch.setattr(VirtualJournal, "record", recorded)
    monkeypatch.setattr(VirtualJournal, "sync", synced)
    monkeypatch.setattr(MemoryNetwork, "send", was_sent)
    return early


def test_the_course_of_a_robot_that_came_back_is_in_the_log_before_it_is_sent(too_early):
    world = a_world(queue_of_two(), faults=["kill:R2@6"])
    world.run(9.0)
    start_again(world, "R2", 78)
    world.run(60.0)
    assert set(states(world).values()) == {ORDER_DONE}
    assert too_early == []


def test_courses_of_those_that_join_and_answers_to_operators_are_in_the_log_first(too_early):
    world = a_world(long_hall(idle("R1", (1.0, 3.0))), stays=True)
    say = operator(world)
    world.run(3.0)
    say(Join(9, "R9", (10.0, 3.0, 1.0), 0.25, 0.8))
    world.add("R9", 0.25, 0.8, 77)
    world.run(4.0)
    say(Said(9, "first", (1.5, 5.0), robot="R9"))
    say(Said(9, "second", (1.5, 1.0), robot="R9"))
    say(Block(9, "wet", ((5.0, 4.1), (5.6, 4.1), (5.6, 5.9), (5.0, 5.9))))
    world.run(1.0)
    say(Cancel(9, "second"))
    world.run(60.0)
    assert states(world)["first"] == ORDER_DONE
    assert world.fleet.blocks
    assert too_early == []
