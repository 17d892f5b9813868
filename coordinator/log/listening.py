"""All of a fleet's traffic recorded by one who only listens, beside the coordinator.

Decides: when such a recording begins and ends.  It puts nothing on any key.

Log times are this host's clock, which on the coordinator's host is the coordinator's.  Everything
carries the stamp of the coordinator's session, so the log tells how long messages were on their
way.
"""

from __future__ import annotations

import platform
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Final, NamedTuple

from coordinator.fleet.log_records import link_record
from coordinator.log.recorder import Recorder
from coordinator.log.unheard_plans import UnheardPlans
from protocol import keys
from protocol.codec import decode
from protocol.host_clock import host_clock_ns
from protocol.messages import PROTOCOL_VERSION, Command
from protocol.phases import OVER
from protocol.timing import SECOND
from protocol.transport import Transport

LINGER_S: Final = 1.0
"""What robots say after the fleet is over still goes into the log, for so long."""

_LOOK_S: Final = 0.2
_SILENT_LOOKS: Final = 25
"""After so many looks without a word the user is told, once."""

_UNHEARD_LOOKS: Final = 10
"""After so many looks at which the same plans were missing the user is told."""

_MOST_KEPT: Final = 100_000
"""So many messages at most are kept before a fleet is known."""

_VERSIONED: Final = ("splinefleet", "eclipse-zenoh", "mcap", "msgspec")


class _Heard(NamedTuple):
    key: str
    payload: bytes
    sent_ns: int | None
    now_ns: int


class Listener:
    """Writes what arrives into a recorder, at the times that `clock` gives [ns].

    `messages` and `links` count what was said, and who came and went; `over` is set when the
    fleet's Command says OVER.
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
        """Subscribe to everything below the fleet's name, and to who is alive.

        `**` is Zenoh's word for any number of parts.
        """
        transport.subscribe(f"{keys.ROOT}/{fleet}/**", self.hear)
        self.watch(transport, fleet)

    def watch(self, transport: Transport, fleet: str) -> None:
        """Subscribe to who is alive, and ask for plans that were not heard."""
        transport.watch_alive(keys.alive(fleet, "*"), self.link_changed)
        self._ask = lambda: transport.ask(keys.plan(fleet, "*"), self.hear_answer)

    def hear(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        """Record a message; the transport calls this one at a time."""
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
        """Record a plan that was asked for, unless it was heard meanwhile."""
        place = keys.split(key)
        message = None if place is None else decode(place[1], payload)
        if place is not None and message is not None and self.unheard.is_news(message, place[2]):
            self.hear(key, payload, sent_ns)

    def link_changed(self, key: str, alive: bool) -> None:
        """Record that a link is there or gone, as the coordinator's own log does."""
        self._recorder.record(key, link_record(alive), self._clock())
        self.links += 1


class _Looks:
    """Counts looks for a word, and calls `silence` once when there was none for long."""

    def __init__(self, silence: Callable[[], None]) -> None:
        self._silence = silence
        self._made = 0

    def count(self, heard: bool) -> None:
        """Count one more look; `heard`: whether anything has been said by now."""
        self._made += 1
        if self._made == _SILENT_LOOKS and not heard:
            self._silence()


class Recording:
    """A recording into `path`, from `begin` to `close`; `speed` is the fleet's.

    A file that is there is replaced only with `replace`.  `silence` is called once when nothing
    was heard for five seconds; `unheard` with the robots whose plans were not heard, nor told when
    asked for, whenever there are others, and once more at the end.
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
        """Create the file and listen; return the fleet's name, which may be the first one heard.

        Raises InputError when the file cannot be created.
        """
        first = None if fleet is not None else FirstFleet(self._clock)
        if first is not None:
            fleet = first.wait(transport, self._silence)
        assert fleet is not None
        metadata = {
            "fleet": fleet,
            "passive": "yes",
            "speed": str(self._speed),
            "protocol": str(PROTOCOL_VERSION),
            "python": platform.python_version(),
            **{name: version(name) for name in _VERSIONED},
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
        """Wait until the fleet is over, or nothing more can be written."""
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
        """End the file; returns how many records it was given.

        Raises LogError when anything could not be written.
        """
        if self._recorder is not None:
            self._recorder.close()
        if self.listener is not None and (missing := self.listener.unheard.robots):
            self._unheard(sorted(missing))
        return 0 if self.listener is None else self.listener.messages + self.listener.links

    def _clock(self) -> int:
        return int(host_clock_ns() * self._speed)


class FirstFleet:
    """What is said before it is known which fleet there is: the first one heard is recorded."""

    def __init__(self, clock: Callable[[], int]) -> None:
        self._clock = clock
        self._kept: deque[_Heard] = deque(maxlen=_MOST_KEPT)
        self._listener: Listener | None = None
        self._found = threading.Event()
        self._fleet = ""
        self._gate = threading.Lock()

    def wait(self, transport: Transport, silence: Callable[[], None] = lambda: None) -> str:
        """Listen to all fleets until one says a Command; return its name."""
        transport.subscribe(f"{keys.ROOT}/**", self._hear)
        looks = _Looks(silence)
        while not self._found.wait(_LOOK_S):
            looks.count(len(self._kept) > 0)
        return self._fleet

    def hand_over(self, listener: Listener) -> None:
        """Give a listener all that the fleet has said, and what it will say."""
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
