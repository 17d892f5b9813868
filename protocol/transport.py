"""The interface to whatever carries the project's bytes.

It has two implementations: Zenoh (protocol/zenoh_transport.py) and the in-memory link with seeded
loss, delay, duplication and reordering (sim/world/memory_transport.py).  One test suite checks
both against what is written here.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Self

Handler = Callable[[str, bytes, int | None], None]
"""Called as handler(key, payload, sent_ns); sent_ns is the sender's time stamp or None.

It may run on any thread and must return at once: it only enqueues.
"""

AliveHandler = Callable[[str, bool], None]
"""Called as handler(key, alive) when a key has become alive or has ceased to be.

The same rules as for Handler.
"""


Answers = Callable[[], Sequence[tuple[str, bytes]]]
"""Called for each query, on any thread; returns (key, payload) of each answer."""


class TransportError(Exception):
    """Raised when the link cannot be opened; the text is one sentence for the user."""


class NoAnswerError(TransportError):
    """Raised when no program answers at a well-formed endpoint: trying again later may help."""


class Transport(ABC):
    """Publish and subscribe on keys, and see whose link is up.

    Obligations of every implementation:
    - Bytes arrive whole or not at all, on the key they were put on.
    - A put may be lost, duplicated, delayed or overtaken by a later one, without notice.
    - A session does not receive its own puts.
    - `put` never blocks for longer than a millisecond and never raises because of the link.
    - A key is alive as long as at least one session that has declared it is open and linked.  A
      process that is killed counts as closed at once, a process whose host or cable falls silent
      counts as closed within the link's detection time.  A process that hangs may keep its link up
      and count as alive.
    - A watcher's handler is called once for each change since the watch began.  A watcher whose own
      link is lost sees all other keys go, and appear again later.  It may or may not see its own
      keys.
    - After `close` no handler is called and puts are ignored; `close` may be called twice.
    """

    @abstractmethod
    def put(self, key: str, payload: bytes) -> None:
        """Send bytes to all subscribers of the key, best effort."""

    @abstractmethod
    def subscribe(self, key_expression: str, handler: Handler) -> None:
        """Call the handler for everything that arrives; `*` matches one part of a key."""

    @abstractmethod
    def declare_alive(self, key: str) -> None:
        """Make the key count as alive for others until this session ends."""

    @abstractmethod
    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Call the handler for every key that is alive already, and at every change from then on.

        `*` stands for one part of a key.
        """

    def answer(self, key_expression: str, answers: Answers) -> None:  # noqa: B027
        """Answer the queries of others on the keys.

        A link need not support queries; this default supports none, and `answers` is never called.
        """

    def ask(self, key_expression: str, handler: Handler) -> None:  # noqa: B027
        """Send a query on the keys and call the handler for each answer; returns at once.

        A query may get no answer, as a put may be lost: whoever needs one asks again.
        """

    @abstractmethod
    def close(self) -> None:
        """End the session."""

    def __enter__(self) -> Self:
        """Return the transport itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the transport."""
        self.close()
