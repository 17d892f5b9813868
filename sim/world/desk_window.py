"""The operator's desk of a fleet in virtual time, which then keeps pace with this machine's clock.

Decides: what the desk hears, and that operators' messages enter the world between two steps of it.
Must not know: what a desk is.
"""

from __future__ import annotations

import queue
import time
from typing import Final

from coordinator.service.tapped_link import TappedLink
from protocol import keys
from protocol.timing import SECOND
from sim.world.virtual_fleet import World

DESK: Final = "desk"
"""The name of the desk's session on the network."""

STEP_S: Final = 0.05
"""The world goes on by so much virtual time [s], and then waits for the clock."""

_CAUGHT_UP_S: Final = 0.5
"""A world that is behind the clock by more than this [s] does not catch up with it."""


class DeskWindow:
    """Connects a world to a desk behind a `link`; `speed`: its seconds in one of this machine's."""

    def __init__(self, world: World, link: TappedLink, speed: float) -> None:
        self._world, self._link, self._speed = world, link, speed
        self._said: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._began = (time.monotonic(), world.now_ns)
        name = world.fleet.name
        for kind in (keys.hello, keys.plan, keys.report, keys.clock, keys.orders, keys.blocks):
            link.subscribe(kind(name, "*"), _hear)
        link.subscribe(keys.command(name), _hear)
        link.watch_alive(keys.alive(name, "*"), lambda _key, _alive: None)
        for key in (keys.order, keys.tell, keys.block, keys.roster):
            link.subscribe(key(name), self._take)
        link.subscribe(keys.admit(name, "*"), self._take)
        driver = world.coordinator.driver
        link.answer(keys.plan(name, "*"), lambda: driver.plans_again(world.now_ns))
        link.answer(keys.orders(name, "*"), driver.orders_again)
        link.answer(keys.blocks(name, "*"), driver.blocks_again)

    def keep_pace(self) -> None:
        """Say what operators have said, and wait until the clock shows the world's time."""
        while not self._said.empty():
            self._link.put(*self._said.get())
        began, begin_ns = self._began
        due = began + (self._world.now_ns - begin_ns) / (SECOND * self._speed)
        behind = time.monotonic() - due
        if behind < 0.0:
            time.sleep(-behind)
        elif behind > _CAUGHT_UP_S:
            self._began = (began + behind - _CAUGHT_UP_S, begin_ns)

    def _take(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        self._said.put((key, payload))


def _hear(_key: str, _payload: bytes, _sent_ns: int | None) -> None:
    """Do nothing: the desk hears it through the pipe."""
