"""The coordinator's shell: the fleet core on a real link, a real clock and a real log.

Decides: when the core's `hear` and `tick` are called.  Everything that arrives and everything that
is sent goes to the recorder with the very `now_ns` that the core saw, so a log can be run again.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from coordinator.fleet import Fleet, Incident, Outgoing
from coordinator.recorder import Recorder
from protocol import keys
from protocol.phases import FREEZE, HOLD
from protocol.timing import COMMAND_PERIOD, SECOND
from protocol.transport import Transport

_WAITING: Final = 10_000
"""Messages that may wait for the core; what a flood adds beyond them is dropped and counted."""

Arrival = tuple[str, bytes, int | None]


class Service:
    """Runs one fleet to its end.

    `clock` gives the coordinator's time in ns, `speed` how many of its seconds pass in one real
    second; `watch` is called after every tick.
    """

    def __init__(
        self,
        fleet: Fleet,
        transport: Transport,
        recorder: Recorder,
        clock: Callable[[], int],
        speed: float = 1.0,
        watch: Callable[[Fleet, int], None] | None = None,
    ) -> None:
        self.fleet = fleet
        self.dropped = 0
        self._transport = transport
        self._recorder = recorder
        self._clock = clock
        self._speed = speed
        self._watch = watch
        self._arrivals: asyncio.Queue[Arrival] = asyncio.Queue(_WAITING)

    async def run(self, patience_s: float) -> bool:
        """Run until the fleet has arrived (True) or has come to rest without arriving (False).

        Also ends with False when not all robots are armed after `patience_s` seconds.
        """
        self._listen(asyncio.get_running_loop())
        began = self._clock()
        due = began
        while True:
            await self._take_until(due)
            now = self._clock()
            self._send(self.fleet.tick(now), now)
            if self._watch is not None:
                self._watch(self.fleet, now)
            due += COMMAND_PERIOD
            if due <= now:
                due = now + COMMAND_PERIOD
            if self.fleet.is_finished:
                return True
            if self.fleet.phase == FREEZE and self.fleet.is_settled(now):
                return False
            if self.fleet.phase == HOLD and now - began > patience_s * SECOND:
                missing = ", ".join(self.fleet.missing(now))
                self.fleet.incidents.append(Incident(now, "timeout", "", f"not armed: {missing}"))
                return False

    def _listen(self, loop: asyncio.AbstractEventLoop) -> None:
        def enqueue(key: str, payload: bytes, sent_ns: int | None) -> None:
            try:
                self._arrivals.put_nowait((key, payload, sent_ns))
            except asyncio.QueueFull:
                self.dropped += 1

        def from_any_thread(key: str, payload: bytes, sent_ns: int | None) -> None:
            if not loop.is_closed():
                loop.call_soon_threadsafe(enqueue, key, payload, sent_ns)

        for kind in (keys.hello, keys.report, keys.clock):
            self._transport.subscribe(kind(self.fleet.name, "*"), from_any_thread)

    async def _take_until(self, due: int) -> None:
        """Feed the core with what arrives until the clock shows `due`."""
        while (left := due - self._clock()) > 0:
            try:
                async with asyncio.timeout(left / SECOND / self._speed):
                    key, payload, sent_ns = await self._arrivals.get()
            except TimeoutError:
                return
            now = self._clock()
            self._recorder.record(key, payload, now, sent_ns)
            self._send(self.fleet.hear(key, payload, now), now)

    def _send(self, messages: list[Outgoing], now_ns: int) -> None:
        for message in messages:
            self._recorder.record(message.key, message.payload, now_ns)
            self._transport.put(message.key, message.payload)
