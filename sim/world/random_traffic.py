"""A sender that puts random bytes on a robot's keys.

Decides: which bytes, on which keys, how often.  Must not know: what the bytes could mean.
"""

from __future__ import annotations

import itertools
import random
import threading
import time
from collections.abc import Iterator
from typing import Final

from protocol import keys
from protocol.key_files import KeyFiles
from protocol.transport import TransportError
from protocol.zenoh_transport import ZenohTransport

RATE: Final = 50.0
"""Messages a second."""

LONGEST: Final = 400
"""The greatest number of bytes: more than a plan of a few control points has."""

_PATIENCE_S: Final = 2.0


def noise(fleet: str, robot: str, seed: int = 0) -> Iterator[tuple[str, bytes]]:
    """Yield keys and random bytes without end; the same seed gives the same sequence."""
    source = random.Random(seed)
    for kind in itertools.cycle((keys.hello, keys.report, keys.clock, keys.plan)):
        yield kind(fleet, robot), source.randbytes(source.randint(0, LONGEST))


class Babbler:
    """Puts noise for some real seconds, with a session and a thread of its own.

    If it cannot connect, it ends without an error.
    """

    def __init__(
        self,
        endpoint: str,
        fleet: str,
        robot: str,
        seconds: float,
        keys: KeyFiles | None = None,
    ) -> None:
        self._endpoint = endpoint
        self._keys = keys
        self._messages = itertools.islice(noise(fleet, robot), round(seconds * RATE))
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name=f"babble {robot}")
        self._thread.start()

    def close(self) -> None:
        """End at once; returns when the session is closed."""
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            transport = ZenohTransport.connect(
                self._endpoint, timeout_s=_PATIENCE_S, keys=self._keys
            )
        except TransportError:
            return
        with transport:
            due = time.monotonic()
            for key, payload in self._messages:
                transport.put(key, payload)
                due += 1.0 / RATE
                if self._over.wait(max(0.0, due - time.monotonic())):
                    return
