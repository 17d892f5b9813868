"""A coordinator's terminal calls a person for what its desk does."""

from coordinator.desk.known_fleet import KnownFleet
from coordinator.fleet.log_records import link_record
from coordinator.scenario.model import Order
from coordinator.service.alarm_bell import AlarmBell
from protocol import keys
from protocol.timing import SECOND
from sim.floors.generator import generate
from tests.sim.world.test_orders_in_time import a_world, replace

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
