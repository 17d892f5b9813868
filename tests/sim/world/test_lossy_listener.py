"""A desk that loses a third of all messages shows the right state soon after they come again."""

from random import Random

import pytest

from coordinator.desk.known_fleet import KnownFleet
from coordinator.scenario.model import Demand
from coordinator.view.live_course import LiveCourse
from protocol import keys
from protocol.timing import SECOND
from sim.floors.generator import generate
from tests.sim.world.test_orders_in_time import a_world, replace

LOSES_S = 40.0
RIGHT_WITHIN_S = 2.0
LOSS = 1 / 3


class Listener:
    """What a desk knows of a world; `loses` decides for each message whether it is lost."""

    def __init__(self, world, loses):
        self._world, self._loses = world, loses
        self.known = KnownFleet(world.fleet.name)
        self.course = LiveCourse(world.fleet.name, world.mission.documents[1])

    def hear(self, key, payload, _sent_ns=None):
        if self._loses():
            return
        now = self._world.now_ns / SECOND
        self.known.hear(key, payload, now)
        self.course.hear(key, payload, now)
        self._ask(now)

    def _ask(self, now):
        driver = self._world.coordinator.driver
        if self.course.unheard.asks(now):
            for answer in driver.plans_again(self._world.now_ns):
                self.hear(*answer)
        if self.course.asks_orders(now):
            for answer in [*driver.orders_again(), *driver.blocks_again()]:
                self.hear(*answer)

    def state(self):
        """What people are shown: robots, orders, and which course each robot drives."""
        now = self._world.now_ns / SECOND
        fleet = self.known.answer(now, {})
        robots = {one.id: (one.phase, one.is_heard, one.order, one.next) for one in fleet.robots}
        orders = {one.id: (one.state, one.robot) for one in self.known.summaries()}
        scene = self.course.scene()
        rides = {
            (epoch.epoch, ride.robot): max(
                one.revision
                for one in epoch.rides
                if one.robot == ride.robot and (one.told is None or one.since is not None)
            )
            for epoch in scene.epochs[-1:]
            for ride in epoch.rides
        }
        return {"phase": fleet.phase, "robots": robots, "orders": orders, "rides": rides}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_listener_that_lost_a_third_is_right_two_seconds_after_messages_come_again(seed):
    made = generate("open", 6, seed)
    places = tuple(robot.goal[:2] for robot in generate("open", 12, seed + 10).robots)
    demand = Demand(places=places, per_robot=30, first_within=2.0, seed=seed)
    world = a_world(replace(made, demand=demand), seed=seed)
    dice, ends_ns = Random(seed), world.now_ns + round(LOSES_S * SECOND)
    lossy = Listener(world, lambda: world.now_ns < ends_ns and dice.random() < LOSS)
    whole = Listener(world, lambda: False)
    for number, listener in enumerate((lossy, whole)):
        session = world._network.session(f"listener-{number}")
        name = world.fleet.name
        for kind in (keys.hello, keys.plan, keys.report, keys.clock, keys.orders, keys.blocks):
            session.subscribe(kind(name, "*"), listener.hear)
        session.subscribe(keys.command(name), listener.hear)
    world.run(LOSES_S)
    assert any(state[0] == "under way" for state in whole.state()["orders"].values())
    world.run(RIGHT_WITHIN_S)
    assert lossy.state() == whole.state()
