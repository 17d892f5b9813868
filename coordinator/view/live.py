"""A running fleet followed: what is heard made into scenes, and both into events for the page.

Decides: what is listened to, and when the page is told.  Must not know: how the page looks.  It
listens only: nothing is ever sent to the fleet, but that it asks the coordinator for plans that it
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
"""The page is told the fleet's time and how old its last word is this often."""


class Feed:
    """What is known of the fleet, for any number of listening pages."""

    def __init__(self, course: LiveCourse) -> None:
        self._course = course
        self._news = threading.Condition()
        self._version = 0
        self._transport: Transport | None = None
        self._made = 0.0

    def listen(self, transport: Transport, fleet: str | None) -> None:
        """Subscribe to all that the fleet says."""
        name = fleet or "*"
        for kind in (keys.hello, keys.plan, keys.report, keys.clock):
            transport.subscribe(kind(name, "*"), self._hear)
        transport.subscribe(keys.command(name), self._hear)
        self._transport = transport

    def scene(self) -> Scene:
        """Return the scene as it is known now."""
        with self._news:
            return self._course.scene()

    def events(self) -> Iterator[tuple[str, str]]:
        """Yield a scene whenever something new is known, the fleet's time and its last word's age.

        A page that hears nothing for some of these periods knows that nobody tells it any more.
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
            clock, word = self._course.clock(now), self._course.word(now)
        if clock is not None:
            yield "clock", msgspec.json.encode(clock).decode()
        if now - self._made < _PERIOD_S:
            word = None  # what was said while a scene was made has not been taken in yet
        yield "word", msgspec.json.encode(word).decode()

    def _hear(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        now = time.monotonic()
        with self._news:
            if self._course.hear(key, payload, now):
                self._version += 1
                self._news.notify_all()
            asks = self._course.unheard.asks(now)
        if asks and self._transport is not None and self._course.fleet is not None:
            self._transport.ask(keys.plan(self._course.fleet, "*"), self._hear)


@contextmanager
def followed(
    endpoint: str, fleet: str | None, plan: Path | None, own: KeyFiles | None = None
) -> Iterator[Feed]:
    """Follow the fleet at an endpoint; `plan` tells the floor and the first epoch, `own` the keys.

    Raises TransportError when nobody is there, InputError for a bad plan file.
    """
    document = None if plan is None else read(plan)
    feed = Feed(LiveCourse(fleet or (document.scenario if document else None), document))
    with ZenohTransport.connect(endpoint, keys=own) as transport:
        feed.listen(transport, fleet)
        yield feed
