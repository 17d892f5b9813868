"""Record all traffic of a fleet with a passive listener, which puts nothing on any key.

Log times are on this host's clock, which on the coordinator's host is the coordinator's clock.
Every message has the time stamp of the coordinator's session, so the log shows how long messages
were under way.

Decides: when such a recording begins and ends.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from coordinator.fleet.log_records import link_record
from coordinator.log import versions
from coordinator.log.recorder import Recorder
from coordinator.log.unheard_plans import UnheardPlans
from protocol import keys
from protocol.codec import decode
from protocol.host_clock import host_clock_ns
from protocol.messages import Command
from protocol.phases import OVER
from protocol.timing import SECOND
from protocol.transport import Transport

LINGER_S: Final = 1.0
"""For how long after the OVER messages are still recorded [s]."""

_LOOK_S: Final = 0.2
_SILENT_LOOKS: Final = 25
"""`silence` is called, once, if no message was heard in this many periods of _LOOK_S."""

_UNHEARD_LOOKS: Final = 10
"""`unheard` is called when the same plans were missing for this many further periods."""

_MOST_KEPT: Final = 100_000
"""How many messages are buffered before a fleet is known."""


class _Heard(NamedTuple):
    key: str
    payload: bytes
    sent_ns: int | None
    now_ns: int


class Listener:
    """A recorder of all that arrives, with the times [ns] that `clock` returns.

    `messages` counts messages, and `links` counts links that came up or went down.  `over` is set
    when the fleet's Command says OVER.
    """

    def __init__(self, fleet: str, recorder: Recorder, clock: Callable[[], int]) -> None:
        self.messages = self.links = 0
        self.over = threading.Event()
        self.unheard = UnheardPlans()
        self._fleet = fleet
        self._recorder = recorder
        self._clock = clock
        self._ask: Callable[[], None] = lambda: None

    def listen(self, transport: Transport, fleet: str) -> None:
        """Subscribe to all keys below the fleet's name, and to its liveliness tokens.

        In a key pattern of Zenoh, `**` matches any number of parts.
        """
        transport.subscribe(f"{keys.ROOT}/{fleet}/**", self.hear)
        self.watch(transport, fleet)

    def watch(self, transport: Transport, fleet: str) -> None:
        """Subscribe to the fleet's liveliness tokens, and ask for plans that were not heard."""
        transport.watch_alive(keys.alive(fleet, "*"), self.link_changed)
        self._ask = lambda: transport.ask(keys.plan(fleet, "*"), self.hear_answer)

    def hear(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        """Record a message; the transport makes one call at a time."""
        self.take(key, payload, sent_ns, self._clock())

    def take(self, key: str, payload: bytes, sent_ns: int | None, now_ns: int) -> None:
        """Record a message that arrived at `now_ns`."""
        self._recorder.record(key, payload, now_ns, sent_ns)
        self.messages += 1
        place = keys.split(key)
        message = None if place is None else decode(place[1], payload)
        if place is None or message is None or place[0] != self._fleet:
            return
        self.unheard.take(message, place[2])
        if self.unheard.asks(now_ns / SECOND):
            self._ask()
        if isinstance(message, Command) and message.phase == OVER:
            self.over.set()

    def hear_answer(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        """Record a plan that arrives as an answer, unless it was heard meanwhile."""
        place = keys.split(key)
        message = None if place is None else decode(place[1], payload)
        if place is not None and message is not None and self.unheard.is_news(message, place[2]):
            self.hear(key, payload, sent_ns)

    def link_changed(self, key: str, alive: bool) -> None:
        """Record that a link came up or went down, as in the coordinator's own log."""
        self._recorder.record(key, link_record(alive), self._clock())
        self.links += 1


class _Looks:
    """A counter of periods of _LOOK_S, which calls `silence` once if no message came for long."""

    def __init__(self, silence: Callable[[], None]) -> None:
        self._silence = silence
        self._made = 0

    def count(self, heard: bool) -> None:
        """Count one more period; `heard` is whether any message was heard until now."""
        self._made += 1
        if self._made == _SILENT_LOOKS and not heard:
            self._silence()


class Recording:
    """A recording into `path`, from `begin` to `close`; `speed` is that of the fleet's clock.

    An existing file is replaced only if `replace` is true.  `silence` is called once if nothing was
    heard for five seconds.  `unheard` is called with the robots whose plans were neither heard nor
    received as an answer: whenever these robots change, and once more at the end.
    """

    def __init__(
        self,
        path: Path,
        speed: float = 1.0,
        *,
        replace: bool = False,
        silence: Callable[[], None] = lambda: None,
        unheard: Callable[[Sequence[str]], None] = lambda _robots: None,
    ) -> None:
        self.path = path
        self._silence = silence
        self._unheard = unheard
        self._replace = replace
        self.listener: Listener | None = None
        self._speed = speed
        self._recorder: Recorder | None = None

    def begin(self, transport: Transport, fleet: str | None = None) -> str:
        """Create the file and listen; return the fleet's name.

        If `fleet` is None, it is the first fleet that is heard.  Raises InputError if the file
        cannot be created.
        """
        first = None if fleet is not None else FirstFleet(self._clock)
        if first is not None:
            fleet = first.wait(transport, self._silence)
        assert fleet is not None
        metadata = {
            "fleet": fleet,
            "passive": "yes",
            "speed": str(self._speed),
            **versions.ours(),
        }
        offset_ns = time.time_ns() - self._clock()
        self._recorder = Recorder(
            self.path, metadata=metadata, wall_offset_ns=offset_ns, replace=self._replace
        )
        self.listener = Listener(fleet, self._recorder, self._clock)
        if first is None:
            self.listener.listen(transport, fleet)
        else:
            first.hand_over(self.listener)
            self.listener.watch(transport, fleet)
        return fleet

    def wait(self) -> None:
        """Wait until the fleet is in phase OVER or the file can no longer be written."""
        listener, recorder = self.listener, self._recorder
        assert listener is not None
        assert recorder is not None
        looks = _Looks(self._silence)
        missing, since = set[str](), 0
        while not listener.over.wait(_LOOK_S) and recorder.error is None:
            looks.count(listener.messages > 0)
            found = set(listener.unheard.robots)
            since = since + 1 if found == missing else 0
            missing = found
            if missing and since == _UNHEARD_LOOKS:
                self._unheard(sorted(missing))
        if recorder.error is None:
            time.sleep(LINGER_S)

    def close(self) -> int:
        """Close the file; return how many records were passed to it.

        Raises LogError if anything could not be written.
        """
        if self._recorder is not None:
            self._recorder.close()
        if self.listener is not None and (missing := self.listener.unheard.robots):
            self._unheard(sorted(missing))
        return 0 if self.listener is None else self.listener.messages + self.listener.links

    def _clock(self) -> int:
        return int(host_clock_ns() * self._speed)


class FirstFleet:
    """A search for the first fleet that is heard, which buffers all messages until then."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._kept: deque[_Heard] = deque(maxlen=_MOST_KEPT)
        self._listener: Listener | None = None
        self._found = threading.Event()
        self._fleet = ""
        self._gate = threading.Lock()

    def wait(self, transport: Transport, silence: Callable[[], None] = lambda: None) -> str:
        """Listen to all fleets until a Command is heard; return its fleet's name."""
        transport.subscribe(f"{keys.ROOT}/**", self._hear)
        looks = _Looks(silence)
        while not self._found.wait(_LOOK_S):
            looks.count(len(self._kept) > 0)
        return self._fleet

    def hand_over(self, listener: Listener) -> None:
        """Pass the fleet's buffered messages, and all later ones, to a listener."""
        with self._gate:
            for heard in self._kept:
                self._pass_on(listener, heard)
            self._kept.clear()
            self._listener = listener

    def _hear(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        heard = _Heard(key, payload, sent_ns, self._clock())
        with self._gate:
            if self._listener is not None:
                self._pass_on(self._listener, heard)
                return
            self._kept.append(heard)
            place = keys.split(key)
            if place is not None and place[1] == "command" and not self._fleet:
                self._fleet = place[0]
                self._found.set()

    def _pass_on(self, listener: Listener, heard: _Heard) -> None:
        if heard.key.startswith(f"{keys.ROOT}/{self._fleet}/"):
            listener.take(*heard)
