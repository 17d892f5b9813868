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
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Final

from coordinator.link_news import link_news
from coordinator.recorder import Recorder
from protocol import keys
from protocol.codec import decode
from protocol.messages import PROTOCOL_VERSION, Command
from protocol.phases import OVER
from protocol.transport import Transport

LINGER_S: Final = 1.0
"""What robots say after the fleet is over still goes into the log, for so long."""

_LOOK_S: Final = 0.2
_VERSIONED: Final = ("splinefleet", "eclipse-zenoh", "mcap", "msgspec")


class Listener:
    """Writes what arrives into a recorder, at the times that `clock` gives [ns].

    `over` is set when the fleet's Command says OVER.
    """

    def __init__(self, fleet: str, recorder: Recorder, clock: Callable[[], int]) -> None:
        self.messages = 0
        self.over = threading.Event()
        self._command = keys.command(fleet)
        self._recorder = recorder
        self._clock = clock

    def listen(self, transport: Transport, fleet: str) -> None:
        """Subscribe to everything below the fleet's name, and to who is alive.

        `**` is Zenoh's word for any number of parts.
        """
        transport.subscribe(f"{keys.ROOT}/{fleet}/**", self.hear)
        transport.watch_alive(keys.alive(fleet, "*"), self.link_changed)

    def hear(self, key: str, payload: bytes, sent_ns: int | None) -> None:
        """Record a message; the transport calls this one at a time."""
        self._recorder.record(key, payload, self._clock(), sent_ns)
        self.messages += 1
        if key == self._command:
            command = decode("command", payload)
            if isinstance(command, Command) and command.phase == OVER:
                self.over.set()

    def link_changed(self, key: str, alive: bool) -> None:
        """Record that a link is there or gone, as the coordinator's own log does."""
        self._recorder.record(key, link_news(alive), self._clock())


class Recording:
    """A recording into `path`, from `begin` to `close`; `speed` is the fleet's."""

    def __init__(self, path: Path, speed: float = 1.0) -> None:
        self.path = path
        self.listener: Listener | None = None
        self._speed = speed
        self._recorder: Recorder | None = None

    def begin(self, transport: Transport, fleet: str) -> None:
        """Create the file and listen; InputError when the file cannot be created."""
        metadata = {
            "fleet": fleet,
            "passive": "yes",
            "speed": str(self._speed),
            "protocol": str(PROTOCOL_VERSION),
            "python": platform.python_version(),
            **{name: version(name) for name in _VERSIONED},
        }
        offset_ns = time.time_ns() - self._clock()
        self._recorder = Recorder(self.path, metadata=metadata, wall_offset_ns=offset_ns)
        self.listener = Listener(fleet, self._recorder, self._clock)
        self.listener.listen(transport, fleet)

    def wait(self) -> None:
        """Wait until the fleet is over, or nothing more can be written."""
        assert self.listener is not None
        assert self._recorder is not None
        while not self.listener.over.wait(_LOOK_S) and self._recorder.error is None:
            pass
        if self._recorder.error is None:
            time.sleep(LINGER_S)

    def close(self) -> int:
        """End the file; returns how many messages it was given.

        Raises LogError when anything could not be written.
        """
        if self._recorder is not None:
            self._recorder.close()
        return 0 if self.listener is None else self.listener.messages

    def _clock(self) -> int:
        return int(time.monotonic_ns() * self._speed)


def first_fleet(transport: Transport) -> str:
    """Wait for any fleet's Command and return the fleet's name."""
    found: list[str] = []
    heard = threading.Event()

    def hear(key: str, _payload: bytes, _sent_ns: int | None) -> None:
        place = keys.split(key)
        if place is not None and not found:
            found.append(place[0])
            heard.set()

    transport.subscribe(keys.command("*"), hear)
    while not heard.wait(_LOOK_S):
        pass
    return found[0]
