"""A coordinator's terminal calls a person for what its desk does."""

import pytest

from coordinator.desk.known_fleet import KnownFleet
from coordinator.fleet.core import Fleet
from coordinator.fleet.log_records import LINK_GONE, LINK_UP, link_record, router_key
from coordinator.fleet.orders import OrderBook
from coordinator.scenario.model import Order
from coordinator.service.alarm_bell import AlarmBell
from protocol import keys
from protocol.messages import Join, Leave
from protocol.timing import SECOND
from sim.floors.generator import generate
from tests.sim.world.test_orders_in_time import (
    a_world,
    admit,
    operator,
    queue_of_two,
    replace,
)

SILENT_S, HEARD_S = 9.0, 14.0


def test_the_terminal_tells_the_alarms_of_the_desk_and_when_they_are_over():
    made = generate("open", 4, 1)
    off = Order(id="off", goal=(-5.0, -5.0), robot="R2", release=4.0)
    world = a_world(replace(made, orders=(off,)), faults=["hang:R1@3:6"], stays=True)
    known, name = KnownFleet(world.fleet.name), world.fleet.name
    session = world._network.session("desk")

    def hear(key, payload, _sent_ns=None):
        known.hear(key, payload, world.now_ns / SECOND)

    for kind in (keys.plan, keys.report, keys.orders):
        session.subscribe(kind(name, "*"), hear)
    session.subscribe(keys.command(name), hear)
    session.watch_alive(keys.alive(name, "*"), lambda key, alive: hear(key, link_record(alive)))

    bell, told = AlarmBell(), {}
    while world.now_ns < SILENT_S * SECOND:
        world.run(0.1)
        news = bell.news(world.fleet, world.now_ns, world.now_ns / SECOND)
        told |= {alarm.id: text for alarm, text in news}
    shown = known.answer(world.now_ns / SECOND, {}).alarms
    assert told.keys() == {"lost-R1", "refused-off"}
    assert told == {one.id: f"{one.text}. {one.todo}" for one in shown}
    told.clear()
    while world.now_ns < HEARD_S * SECOND:
        world.run(0.1)
        news = bell.news(world.fleet, world.now_ns, world.now_ns / SECOND)
        told |= {alarm.id: text for alarm, text in news}
    (lost,) = [one.text for one in shown if one.id == "lost-R1"]
    assert told == {"lost-R1": f"over: {lost}"}


def rung(bell, world, seconds):
    """The lines of a bell that is looked at for so long."""
    told = []
    for _ in range(round(10 * seconds)):
        world.go_on(0.1)
        news = bell.news(world.fleet, world.now_ns, world.now_ns / SECOND)
        told += [text.partition(". ")[0] for _, text in news]
    return told


BACK = "R2 is back and has no course"


@pytest.mark.parametrize(("waits_s", "over"), [(0.2, []), (3.0, [f"over: {BACK}"])])
def test_a_robot_that_is_back_calls_a_person_until_it_is_admitted_and_not_later(waits_s, over):
    world, bell = a_world(queue_of_two(), faults=["kill:R2@6"]), AlarmBell()
    assert rung(bell, world, 12.0) == ["R2 is not heard"]
    world.renew("R2", 78, world.robots["R2"].body.true_pose())
    assert (BACK in rung(bell, world, waits_s)) == bool(over)
    admit(world, "R2")
    assert [text for text in rung(bell, world, 10.0) if BACK in text] == over


def test_a_router_that_is_gone_calls_a_person_once_and_no_robot_does():
    world, bell = a_world(queue_of_two(), stays=True), AlarmBell()
    fleet = world.fleet
    assert rung(bell, world, 5.0) == []
    link = router_key(fleet.name)
    fleet.hear(link, LINK_UP, world.now_ns)
    fleet.hear(link, LINK_GONE, world.now_ns)
    for robot in ("R1", "R2", "R3"):
        fleet.hear(keys.alive(fleet.name, robot), LINK_GONE, world.now_ns)
    cut = "the router is gone: robots stand where their authority ends"
    times = [(world.now_ns + passed * SECOND, 5.0 + passed) for passed in (1, 2, 3)]
    assert [one.text for when in times for one, _ in bell.news(fleet, *when)] == [cut]
    fleet.hear(link, LINK_UP, world.now_ns)
    assert f"over: {cut}" in rung(bell, world, 6.0)


def test_robots_that_are_yet_to_be_started_call_nobody():
    fleet, bell = a_world(queue_of_two()).fleet, AlarmBell()
    for now_s in range(1, 30):
        assert list(bell.news(fleet, now_s * SECOND, float(now_s))) == []


def test_a_robot_that_was_taken_out_unheard_calls_a_person_until_it_joins_again():
    world, bell = a_world(queue_of_two(), faults=["hang:R2@6:6"], stays=True), AlarmBell()
    say, left = operator(world), "R2 was taken out, but is heard: it may be on the floor"
    assert rung(bell, world, 12.0) == ["R2 is not heard"]
    say(Leave(9, "R2", "root"))
    assert "over: R2 is not heard" in rung(bell, world, 1.0)
    assert "R2 was taken out, by root" in [one.text for one in world.fleet.incidents]
    task = world.fleet.orders.tasks["leave-R2"]
    assert task.reason == "R2 was not heard: others drive where it may still stand"
    assert rung(bell, world, 6.0) == [left]
    again = Fleet.of_plain(world.fleet.plain(), OrderBook())
    assert again.outside_ns == world.fleet.outside_ns
    x, y, heading = world.robots["R2"].body.true_pose()
    say(Join(9, "R2", (x, y, heading), 0.2, 0.5))
    assert rung(bell, world, 1.0) == [f"over: {left}"]


def test_a_robot_that_was_heard_when_it_was_taken_out_calls_a_person_after_a_minute():
    world, bell = a_world(queue_of_two(), stays=True), AlarmBell()
    assert rung(bell, world, 60.0) == []
    operator(world)(Leave(9, "R2"))
    assert rung(bell, world, 5.0) == []
    assert set(world.fleet.members) == {"R1", "R3"}
    assert world.fleet.orders.tasks["leave-R2"].reason == ""
    assert rung(bell, world, 50.0) == []
    assert rung(bell, world, 8.0) == ["R2 was taken out, but is heard: it may be on the floor"]
