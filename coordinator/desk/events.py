"""The stream of events that pages and programs listen to.

Decides: which events there are, and how often.  Must not know: HTTP.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from typing import Final

import msgspec

from coordinator.desk.answers import FleetAnswer, RobotState
from coordinator.desk.differences import difference
from coordinator.desk.known_fleet import KnownFleet
from coordinator.desk.line import Line

_PERIOD_S: Final = 0.25
"""Interval [s] at which something is sent even if nothing is new: who gets nothing for several
periods knows that the desk has ended."""


async def events(line: Line, *, with_scenes: bool = False) -> AsyncIterator[tuple[str, str]]:
    """Yield (event, JSON in one line) without end; ("", "") keeps the connection alive."""
    seen, news, shown = -1, _News(with_orders=not with_scenes), None
    while True:
        fresh = await line.changed(seen, _PERIOD_S)
        is_new, seen = line.version != seen, line.version
        if with_scenes and is_new:
            scene = line.scene_json()
            if shown is None:
                yield "scene", _line(scene)
            elif (told := difference(shown, scene)) is not None:
                yield "change", _line(told)
            shown = scene
        if with_scenes:
            for one in _times(line, word=not is_new):
                yield one
        for one in news.of(line.fleet(), line.known):
            yield one
        if not with_scenes:
            yield "", ""
        if fresh:
            await asyncio.sleep(_PERIOD_S)


def _times(line: Line, *, word: bool) -> Iterator[tuple[str, str]]:
    """Yield what moves the page; no `word` right after a scene: messages have waited meanwhile."""
    clock, last, late = line.times()
    if clock is not None:
        yield "clock", _line(clock)
    if late is not None:
        yield "late", _line(late)
    yield "word", _line(last if word else None)


class _News:
    """What one listener has not been told yet; a scene holds the orders already."""

    def __init__(self, *, with_orders: bool) -> None:
        self._with_orders = with_orders
        self._robots: dict[str, RobotState] = {}
        self._orders = 0
        self._fleet: FleetAnswer | None = None

    def of(self, fleet: FleetAnswer, known: KnownFleet) -> Iterator[tuple[str, str]]:
        """Yield the fleet if anything about it is new, with the robots that are; new orders."""
        still = {one.id: msgspec.structs.replace(one, age=None) for one in fleet.robots}
        robots = [one for one in fleet.robots if self._robots.get(one.id) != still[one.id]]
        rest = msgspec.structs.replace(fleet, age=None, robots=[])
        if robots or rest != self._fleet:
            yield "fleet", _line(msgspec.structs.replace(fleet, robots=robots))
        if gone := sorted(self._robots.keys() - still.keys()):
            yield "gone", _line(gone)
        self._robots, self._fleet = still, rest
        if not self._with_orders:
            return
        orders, self._orders = known.changed_orders(self._orders), known.order_changes
        for one in orders:
            yield "order", _line(one)


def _line(data: object) -> str:
    return msgspec.json.encode(data).decode()
