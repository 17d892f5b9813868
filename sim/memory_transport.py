"""The transport in memory and in virtual time: a network that loses, delays, doubles and reorders.

Decides: what happens to each message, from a seed alone.  No threads and no clock: nothing is
delivered but by `advance`, so the same seed and the same calls give the same deliveries.
"""

from __future__ import annotations

import heapq
import random
from typing import Final, NamedTuple

from protocol.transport import Handler, Transport

LONGEST_HOLD_NS: Final = 50_000_000
"""A message that is to be overtaken, and the second copy of a doubled one, wait up to this."""


class _Flight(NamedTuple):
    """One message on its way to one session; the order of the fields is the order of delivery."""

    due_ns: int
    sequence: int
    sender: str
    receiver: MemorySession
    key: str
    payload: bytes
    sent_ns: int


class MemoryNetwork:
    """Carries messages between sessions in virtual time.

    loss, doubling, reordering: the probabilities that a message is lost, comes twice, is held
    back so that later ones overtake it; drawn apart for each receiving session.  delay_ns: the
    shortest and the longest delay; messages between two sessions keep their order but for those
    held back.  Raises ValueError for numbers outside these meanings.
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        loss: float = 0.0,
        delay_ns: tuple[int, int] = (0, 0),
        doubling: float = 0.0,
        reordering: float = 0.0,
    ) -> None:
        for name, value in (("loss", loss), ("doubling", doubling), ("reordering", reordering)):
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"{name} is {value}, a probability lies between 0 and 1")
        if not 0 <= delay_ns[0] <= delay_ns[1]:
            raise ValueError(f"delay_ns {delay_ns} is no range of delays")
        self.now_ns = 0
        self._random = random.Random(seed)
        self._loss = loss
        self._delay_ns = delay_ns
        self._doubling = doubling
        self._reordering = reordering
        self._sessions: dict[str, MemorySession] = {}
        self._cut: set[str] = set()
        self._flights: list[_Flight] = []
        self._sequence = 0
        self._latest_due: dict[tuple[str, str], int] = {}
        self._routes: dict[str, list[MemorySession]] = {}

    def session(self, name: str) -> MemorySession:
        """Open a session; ValueError when one of that name is open."""
        if name in self._sessions:
            raise ValueError(f"session {name!r} is open already")
        self._sessions[name] = MemorySession(self, name)
        return self._sessions[name]

    def advance(self, now_ns: int) -> None:
        """Deliver what is due up to now_ns, in order; ValueError when time would run backwards."""
        if now_ns < self.now_ns:
            raise ValueError(f"time would run backwards, from {self.now_ns} ns to {now_ns} ns")
        while self._flights and self._flights[0].due_ns <= now_ns:
            flight = heapq.heappop(self._flights)
            self.now_ns = flight.due_ns
            if flight.sender not in self._cut and flight.receiver.name not in self._cut:
                flight.receiver.deliver(flight.key, flight.payload, flight.sent_ns)
        self.now_ns = now_ns

    def next_due_ns(self) -> int | None:
        """Return the time of the next delivery, or None when nothing is on its way."""
        return self._flights[0].due_ns if self._flights else None

    def cut(self, name: str) -> None:
        """Lose everything from and to the session of this name until `heal`, now on its way too."""
        self._cut.add(name)

    def heal(self, name: str) -> None:
        """End a cut."""
        self._cut.discard(name)

    def send(self, sender: str, key: str, payload: bytes) -> None:
        """Put a message on its way to every other session that subscribes to its key."""
        for receiver in self._receivers(key):
            if receiver.name == sender:
                continue
            lost, doubled, held = (self._random.random() for _ in range(3))
            delay_ns = self._random.randint(*self._delay_ns)
            hold_ns = self._random.randint(1, LONGEST_HOLD_NS)
            if lost < self._loss or sender in self._cut or receiver.name in self._cut:
                continue
            due_ns = self.now_ns + delay_ns
            if held < self._reordering:
                due_ns += hold_ns
            else:
                link = (sender, receiver.name)
                due_ns = max(due_ns, self._latest_due.get(link, 0))
                self._latest_due[link] = due_ns
            self._launch(due_ns, sender, receiver, key, payload)
            if doubled < self._doubling:
                self._launch(due_ns + hold_ns, sender, receiver, key, payload)

    def forget_routes(self) -> None:
        """Find anew who subscribes to what."""
        self._routes.clear()

    def forget(self, name: str) -> None:
        """Remove a closed session."""
        del self._sessions[name]
        self._routes.clear()

    def _receivers(self, key: str) -> list[MemorySession]:
        if key not in self._routes:
            self._routes[key] = [s for s in self._sessions.values() if s.wants(key)]
        return self._routes[key]

    def _launch(
        self, due_ns: int, sender: str, receiver: MemorySession, key: str, payload: bytes
    ) -> None:
        self._sequence += 1
        heapq.heappush(
            self._flights,
            _Flight(due_ns, self._sequence, sender, receiver, key, payload, self.now_ns),
        )


class MemorySession(Transport):
    """One party on a MemoryNetwork; `sent_ns` is the virtual time of the put."""

    def __init__(self, network: MemoryNetwork, name: str) -> None:
        self.name = name
        self._network = network
        self._subscriptions: list[tuple[list[str], Handler]] = []
        self._closed = False

    def put(self, key: str, payload: bytes) -> None:
        """Send bytes; nothing arrives before the network's next `advance`."""
        if not self._closed:
            self._network.send(self.name, key, payload)

    def subscribe(self, key_expression: str, handler: Handler) -> None:
        """Call the handler, from within `advance`, for what other sessions put."""
        if not self._closed:
            self._subscriptions.append((key_expression.split("/"), handler))
            self._network.forget_routes()

    def close(self) -> None:
        """End the session; what it has put before still arrives."""
        if not self._closed:
            self._closed = True
            self._network.forget(self.name)

    def wants(self, key: str) -> bool:
        """Tell whether a handler subscribes to the key."""
        parts = key.split("/")
        return any(_matches(expression, parts) for expression, _ in self._subscriptions)

    def deliver(self, key: str, payload: bytes, sent_ns: int) -> None:
        """Hand a message that has arrived to every handler that subscribes to its key."""
        parts = key.split("/")
        for expression, handler in tuple(self._subscriptions):
            if not self._closed and _matches(expression, parts):
                handler(key, payload, sent_ns)


def _matches(expression: list[str], parts: list[str]) -> bool:
    """Tell whether a key fits; `*` stands for exactly one part."""
    return len(expression) == len(parts) and all(
        wanted in ("*", part) for wanted, part in zip(expression, parts, strict=True)
    )
