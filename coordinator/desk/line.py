"""The desk's link to one fleet: hears everything, and says an operator's messages until answered.

Decides: how often a message is said again, and for how long an answer is waited for.  Must not
know: HTTP.  Everything runs in one event loop; the transport calls from its own threads.
"""

from __future__ import annotations

import asyncio
import os
import time
from collections import Counter
from collections.abc import Callable
from typing import Final, TypeVar

from coordinator.desk.answers import FleetAnswer
from coordinator.desk.differences import Json, plain
from coordinator.desk.known_fleet import KnownFleet
from coordinator.fleet.log_records import link_record
from coordinator.view.live_course import LiveCourse
from coordinator.view.scene import Scene
from protocol import keys
from protocol.codec import encode
from protocol.messages import Message, Operators
from protocol.transport import Transport

_AGAIN_S: Final = 0.2
_MOST_HEARD: Final = 20_000
"""Messages that wait to be looked at; further ones are dropped and counted."""


Answer = TypeVar("Answer")


class Line:
    """One fleet as it is heard, and where an operator's messages go.

    `course`: what the page draws.  `by`: who speaks if nobody is named.
    """

    def __init__(self, transport: Transport, course: LiveCourse, by: str = "") -> None:
        self.known = KnownFleet(course.fleet, time.time() - time.monotonic())
        self.dropped: Counter[str] = Counter()
        self.boot = int.from_bytes(os.urandom(4), "little")
        self.by = by
        self.floor = course.floor
        self._course = course
        self._transport = transport
        self._loop: asyncio.AbstractEventLoop | None = None
        self._waiting = 0
        self._version = 0
        self._drawn: tuple[int, Json] = (-1, None)
        self._news = asyncio.Event()
        self._asking: set[Callable[[Message], None]] = set()

    def listen(self) -> None:
        """Subscribe to all messages of the fleet; to be called in the event loop."""
        self._loop = asyncio.get_running_loop()
        name = self.known.fleet or "*"
        for kind in (keys.hello, keys.plan, keys.report, keys.clock, keys.orders, keys.blocks):
            self._transport.subscribe(kind(name, "*"), self._from_any_thread)
        self._transport.subscribe(keys.command(name), self._from_any_thread)

        def link_changed(key: str, alive: bool) -> None:
            self._from_any_thread(key, link_record(alive), None)

        self._transport.watch_alive(keys.alive(name, "*"), link_changed)

    @property
    def version(self) -> int:
        """A number that grows with everything that a page would show."""
        return self._version

    def scene(self) -> Scene:
        """Return the scene of what is known now."""
        return self._course.scene()

    def scene_json(self) -> Json:
        """Return the scene as a value of JSON, made once for everything that is known."""
        if self._drawn[0] != self._version:
            self._drawn = (self._version, plain(self.scene()))
        return self._drawn[1]

    def times(self) -> tuple[object, object, object]:
        """Return the fleet's time, the age of the last Command, and how far late robots are."""
        now = time.monotonic()
        course = self._course
        return course.clock(now), course.word(now), course.late()

    def fleet(self) -> FleetAnswer:
        """Return the fleet as it is known now."""
        return self.known.answer(time.monotonic(), self._course.held_now())

    def log_failed(self, text: str) -> None:
        """Take in, from any thread, that the coordinator cannot write its log any more."""
        if self._loop is not None and not self._loop.is_closed():
            wall_s = time.time()
            self._loop.call_soon_threadsafe(self.known.alarms.log_failed, text, wall_s)

    def is_heard(self) -> bool:
        """Return whether the coordinator is heard now."""
        return self.known.is_heard(time.monotonic())

    async def changed(self, seen: int, patience_s: float) -> bool:
        """Wait until something is known that was not at version `seen`; False if it takes long."""
        if self._version == seen:
            self._news.clear()
            try:
                async with asyncio.timeout(patience_s):
                    await self._news.wait()
            except TimeoutError:
                return False
        return True

    async def ask(
        self,
        key: Callable[[str], str],
        message: Operators,
        fits: Callable[[Message], Answer | None],
        patience_s: float,
        again_s: float = _AGAIN_S,
    ) -> Answer | None:
        """Say a message every `again_s` until something heard is an answer; None if nothing is."""
        return await self._until(
            fits, patience_s, lambda fleet: self._put(key(fleet), message), again_s
        )

    async def await_answer(
        self, fits: Callable[[Message], Answer | None], patience_s: float
    ) -> Answer | None:
        """Wait until something heard is an answer; None if nothing is."""
        return await self._until(fits, patience_s, lambda _: None)

    def _put(self, key: str, message: Operators) -> None:
        self._transport.put(key, encode(message))

    async def _until(
        self,
        fits: Callable[[Message], Answer | None],
        patience_s: float,
        say: Callable[[str], None],
        again_s: float = _AGAIN_S,
    ) -> Answer | None:
        found: asyncio.Future[Answer] = asyncio.get_running_loop().create_future()

        def look(message: Message) -> None:
            if not found.done() and (answer := fits(message)) is not None:
                found.set_result(answer)

        self._asking.add(look)
        deadline = time.monotonic() + patience_s
        try:
            while (left := deadline - time.monotonic()) > 0.0:
                if self.known.fleet is not None:
                    say(self.known.fleet)
                await asyncio.wait((found,), timeout=min(again_s, left))
                if found.done():
                    return found.result()
        finally:
            self._asking.discard(look)
        return None

    def _from_any_thread(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        loop = self._loop
        if loop is None or loop.is_closed():
            return
        if self._waiting >= _MOST_HEARD:
            self.dropped["heard too much"] += 1
            return
        self._waiting += 1
        loop.call_soon_threadsafe(self._hear, key, payload)

    def _hear(self, key: str, payload: bytes) -> None:
        self._waiting -= 1
        now = time.monotonic()
        heard = self.known.hear(key, payload, now)
        if self._course.hear(key, payload, now):
            self._version += 1
            self._news.set()
        if heard is not None:
            for look in self._asking:
                look(heard)
        self._ask(now)

    def _ask(self, now: float) -> None:
        """Ask for what was missed."""
        fleet = self.known.fleet
        if fleet is None:
            return
        if self._course.unheard.asks(now):
            self._transport.ask(keys.plan(fleet, "*"), self._from_any_thread)
        if self._course.asks_orders(now):
            self._transport.ask(keys.orders(fleet, "*"), self._from_any_thread)
            self._transport.ask(keys.blocks(fleet, "*"), self._from_any_thread)
