"""Follows a running fleet and turns what it hears into scenes and events for the page.

Decides: what it listens to, and when the page gets an event.  Must not know: how the page looks.
It only listens and sends nothing to the fleet, except requests to the coordinator for plans that it
has not heard.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import msgspec

from coordinator.plan.plan_file import read
from coordinator.view.live_course import LiveCourse
from coordinator.view.page import scene_json
from coordinator.view.scene import Scene
from protocol import keys
from protocol.key_files import KeyFiles
from protocol.transport import Transport
from protocol.zenoh_transport import ZenohTransport

_PERIOD_S: Final = 0.25
"""Interval [s] at which the page gets the fleet's time and the age of the last Command."""


class Feed:
    """The scenes and events of a running fleet, for any number of listening pages."""

    def __init__(self, course: LiveCourse) -> None:
        self._course = course
        self._news = threading.Condition()
        self._version = 0
        self._transport: Transport | None = None
        self._made = 0.0

    def listen(self, transport: Transport, fleet: str | None) -> None:
        """Subscribe to all messages of the fleet."""
        name = fleet or "*"
        for kind in (keys.hello, keys.plan, keys.report, keys.clock, keys.orders):
            transport.subscribe(kind(name, "*"), self._hear)
        transport.subscribe(keys.command(name), self._hear)
        self._transport = transport

    def scene(self) -> Scene:
        """Return the scene of what is known now."""
        with self._news:
            return self._course.scene()

    def events(self) -> Iterator[tuple[str, str]]:
        """Yield a scene whenever something new is known, and regularly the times and LateRides.

        A page that gets no event for several periods knows that this server has ended.
        """
        seen = -1
        while True:
            with self._news:
                fresh = self._version != seen or self._news.wait(_PERIOD_S)
                scene = self._course.scene() if fresh else None
                seen = self._version
                self._made = time.monotonic() if fresh else self._made
            if scene is not None:
                yield "scene", scene_json(scene)
            yield from self._times()
            if scene is not None:
                time.sleep(_PERIOD_S)

    def _times(self) -> Iterator[tuple[str, str]]:
        with self._news:
            now = time.monotonic()
            clock, word, late = self._course.clock(now), self._course.word(now), self._course.late()
        if clock is not None:
            yield "clock", msgspec.json.encode(clock).decode()
        if late is not None:
            yield "late", msgspec.json.encode(late).decode()
        if now - self._made < _PERIOD_S:
            word = None  # messages that came while a scene was made are not processed yet
        yield "word", msgspec.json.encode(word).decode()

    def _hear(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        now = time.monotonic()
        with self._news:
            if self._course.hear(key, payload, now):
                self._version += 1
                self._news.notify_all()
            lacks = self._course.unheard.asks(now), self._course.asks_orders(now)
            fleet = self._course.fleet
        if self._transport is None or fleet is None:
            return
        for asks, key in zip(lacks, (keys.plan(fleet, "*"), keys.orders(fleet, "*")), strict=True):
            if asks:
                self._transport.ask(key, self._hear)


@contextmanager
def followed(
    endpoint: str, fleet: str | None, plan: Path | None, own: KeyFiles | None = None
) -> Iterator[Feed]:
    """Follow the fleet at an endpoint.

    `plan`: a plan file with the floor and the first epoch; `own`: the listener's keys.  Raise
    TransportError if nobody answers at the endpoint, InputError if the plan file is not valid.
    """
    document = None if plan is None else read(plan)
    feed = Feed(LiveCourse(fleet or (document.scenario if document else None), document))
    with ZenohTransport.connect(endpoint, keys=own) as transport:
        feed.listen(transport, fleet)
        yield feed
