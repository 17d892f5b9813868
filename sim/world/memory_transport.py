"""The in-memory transport in virtual time: it loses, delays, duplicates and reorders messages.

Decides: what happens to each message, from a seed alone.  It has no threads and no clock: only
`advance` delivers, so the same seed and the same calls give the same deliveries.

Liveliness changes are never lost and need no random numbers: watchers learn of them after the
longest delay of the network.
"""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from typing import Final, NamedTuple

from protocol.keys import fits
from protocol.transport import AliveHandler, Handler, Transport
from sim.world.memory_liveliness import CUT_NOTICE_NS, Liveliness

LONGEST_HOLD_NS: Final = 50_000_000
"""The longest extra delay of a message that is to be overtaken, and of a duplicate."""

DROP_NOTICE_NS: Final = 100_000_000
"""How long a killed session counts as alive, unless the network has another drop_notice_ns."""

Fate = Callable[[str, int], int | None]


class _Flight(NamedTuple):
    """One message on its way to one session; flights are delivered in the order of these tuples."""

    due_ns: int
    sequence: int
    sender: str
    receiver: MemorySession
    key: str
    payload: bytes
    sent_ns: int


class _Look(NamedTuple):
    """A time at which every watcher's view of live keys is updated; ordered among the flights."""

    due_ns: int
    sequence: int


class MemoryNetwork:
    """Carries messages between sessions in virtual time.

    loss, doubling, reordering: the probabilities that a message is lost, arrives twice, or is held
    back so that later ones overtake it; the choice is made separately for each receiving session.
    delay_ns: the shortest and the longest delay; messages between two sessions arrive in order,
    except for those held back.  drop_notice_ns: how long a session counts as alive after `drop`.
    fate: how much longer [ns] a message on a key takes that is sent at a time; None if it is lost.
    Messages that take longer hold up no others.
    Raises ValueError for numbers out of range.
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        loss: float = 0.0,
        delay_ns: tuple[int, int] = (0, 0),
        doubling: float = 0.0,
        reordering: float = 0.0,
        drop_notice_ns: int = DROP_NOTICE_NS,
        fate: Fate = lambda _key, _now_ns: 0,
    ) -> None:
        for name, value in (("loss", loss), ("doubling", doubling), ("reordering", reordering)):
            if not 0.0 <= value <= 1.0:
                raise ValueError(f"{name} is {value}, but a probability is 0 to 1")
        if not 0 <= delay_ns[0] <= delay_ns[1]:
            raise ValueError(f"delay_ns {delay_ns} is not (least, most) with 0 <= least <= most")
        if drop_notice_ns < 0:
            raise ValueError(f"drop_notice_ns is {drop_notice_ns}, which is negative")
        self.now_ns = 0
        dice = random.Random(seed)
        self._chance, self._bits = dice.random, dice.getrandbits
        self._loss = loss
        self._delay_ns = delay_ns
        self._doubling = doubling
        self._reordering = reordering
        self._sessions: dict[str, MemorySession] = {}
        self._drop_notice_ns = drop_notice_ns
        self._fate = fate
        self._cut: dict[str, int] = {}
        self._held: dict[str, list[_Flight]] = {}
        self._liveliness = Liveliness()
        self._due: list[_Flight | _Look] = []
        self._sequence = 0
        self._latest_due: dict[tuple[str, str, int], int] = {}
        self._routes: dict[str, list[MemorySession]] = {}

    def session(self, name: str) -> MemorySession:
        """Open a session; ValueError when a session of that name is open."""
        if name in self._sessions:
            raise ValueError(f"session {name!r} is open already")
        self._sessions[name] = MemorySession(self, name)
        return self._sessions[name]

    def advance(self, now_ns: int) -> None:
        """Deliver what is due up to now_ns, in order; ValueError when time would run backwards."""
        if now_ns < self.now_ns:
            raise ValueError(f"time would run backwards, from {self.now_ns} ns to {now_ns} ns")
        due = self._due
        while due and due[0].due_ns <= now_ns:
            event = heapq.heappop(due)
            self.now_ns = event.due_ns
            if isinstance(event, _Look):
                self._liveliness.look(self.now_ns, self._cut)
            elif self._is_cut(event.sender, event.receiver.name):
                continue
            elif event.receiver.name in self._held:
                self._held[event.receiver.name].append(event)
            else:
                event.receiver.deliver(event.key, event.payload, event.sent_ns)
        self.now_ns = now_ns

    def next_due_ns(self) -> int | None:
        """Return the time of the next delivery, or None when nothing is on its way."""
        return self._due[0].due_ns if self._due else None

    def cut(self, name: str) -> None:
        """Lose all messages from and to the session until `heal`, including those under way.

        The other sessions see it as alive for another CUT_NOTICE_NS, and for the same time it sees
        them as alive.
        """
        self._cut.setdefault(name, self.now_ns)
        self._look_after(CUT_NOTICE_NS)

    def heal(self, name: str) -> None:
        """End a cut."""
        self._cut.pop(name, None)
        self._look_after(self._delay_ns[1])

    def hold(self, name: str) -> None:
        """Let messages to the session wait until `release`, as if its process hung."""
        self._held.setdefault(name, [])

    def release(self, name: str) -> None:
        """End a hold and deliver all waiting messages now, in order."""
        for waiting in self._held.pop(name, []):
            waiting.receiver.deliver(waiting.key, waiting.payload, waiting.sent_ns)

    def drop(self, name: str) -> None:
        """Kill a session: it sends and receives nothing more.

        Others see it gone after `drop_notice_ns`.  What it has put before still arrives, and a new
        session of the name can be opened at once; a process that hung takes that with it.  Raises
        ValueError when no session of that name is open.
        """
        if name not in self._sessions:
            raise ValueError(f"session {name!r} is not open")
        self._held.pop(name, None)
        self._sessions[name].end(self._drop_notice_ns)

    def send(self, sender: str, key: str, payload: bytes) -> None:
        """Put a message on its way to every other session that subscribes to its key."""
        chance, below, now_ns = self._chance, self._below, self.now_ns
        least_ns, most_ns = self._delay_ns
        for receiver in self._receivers(key):
            if receiver.name == sender:
                continue
            lost, doubled, held = chance(), chance(), chance()
            delay_ns = least_ns + below(most_ns - least_ns + 1)
            hold_ns = 1 + below(LONGEST_HOLD_NS)
            late_ns = self._fate(key, now_ns)
            if late_ns is None or lost < self._loss or self._is_cut(sender, receiver.name):
                continue
            due_ns = now_ns + delay_ns + late_ns
            if held < self._reordering:
                due_ns += hold_ns
            else:
                link = (sender, receiver.name, late_ns)
                due_ns = max(due_ns, self._latest_due.get(link, 0))
                self._latest_due[link] = due_ns
            self._launch(due_ns, sender, receiver, key, payload)
            if doubled < self._doubling:
                self._launch(due_ns + hold_ns, sender, receiver, key, payload)

    def _below(self, count: int) -> int:
        """Return a random number from 0 to count - 1, the one that `randrange` would return."""
        size = count.bit_length()
        number = self._bits(size)
        while number >= count:
            number = self._bits(size)
        return number

    def _is_cut(self, sender: str, receiver: str) -> bool:
        return bool(self._cut) and (sender in self._cut or receiver in self._cut)

    def forget_routes(self) -> None:
        """Discard the cached receivers of each key."""
        self._routes.clear()

    def declare(self, owner: str, key: str) -> None:
        """Make a key count as alive until the session that owns it is forgotten."""
        self._liveliness.declare(owner, key, self.now_ns + self._delay_ns[1])
        self._look_after(self._delay_ns[1])

    def watch(self, watcher: str, expression: str, handler: AliveHandler) -> None:
        """Call a session's handler when keys become alive or are gone."""
        self._liveliness.watch(watcher, expression, handler, self.now_ns + self._delay_ns[1])
        self._look_after(self._delay_ns[1])

    def forget(self, name: str, notice_ns: int | None = None) -> None:
        """Remove a closed session; its keys are gone after notice_ns (the longest delay)."""
        if notice_ns is None:
            notice_ns = self._delay_ns[1]
        self._liveliness.forget(name, self.now_ns + notice_ns)
        self._look_after(notice_ns)
        del self._sessions[name]
        self._routes.clear()

    def _look_after(self, delay_ns: int) -> None:
        if self._liveliness.is_used:
            self._sequence += 1
            heapq.heappush(self._due, _Look(self.now_ns + delay_ns, self._sequence))

    def _receivers(self, key: str) -> list[MemorySession]:
        if key not in self._routes:
            self._routes[key] = [s for s in self._sessions.values() if s.wants(key)]
        return self._routes[key]

    def _launch(
        self, due_ns: int, sender: str, receiver: MemorySession, key: str, payload: bytes
    ) -> None:
        self._sequence += 1
        heapq.heappush(
            self._due,
            _Flight(due_ns, self._sequence, sender, receiver, key, payload, self.now_ns),
        )


class MemorySession(Transport):
    """One party on a MemoryNetwork; `sent_ns` is the virtual time of the put."""

    def __init__(self, network: MemoryNetwork, name: str) -> None:
        self.name = name
        self._network = network
        self._subscriptions: list[tuple[list[str], Handler]] = []
        self._handlers: dict[str, list[Handler]] = {}
        self._closed = False

    def put(self, key: str, payload: bytes) -> None:
        """Send bytes; nothing arrives before the network's next `advance`."""
        if not self._closed:
            self._network.send(self.name, key, payload)

    def subscribe(self, key_expression: str, handler: Handler) -> None:
        """Call the handler, from within `advance`, for what other sessions put."""
        if not self._closed:
            self._subscriptions.append((key_expression.split("/"), handler))
            self._handlers = {}
            self._network.forget_routes()

    def declare_alive(self, key: str) -> None:
        """Make the key count as alive for others until this session is closed or dropped."""
        if not self._closed:
            self._network.declare(self.name, key)

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Call the handler, from within `advance`, when a key appears or is gone."""
        if not self._closed:
            self._network.watch(self.name, key_expression, handler)

    def close(self) -> None:
        """End the session; what it has put before still arrives."""
        self.end()

    def end(self, notice_ns: int | None = None) -> None:
        """End the session; its keys are gone after notice_ns (the network's longest delay)."""
        if not self._closed:
            self._closed = True
            self._network.forget(self.name, notice_ns)

    def wants(self, key: str) -> bool:
        """Return whether the session has subscribed to the key."""
        parts = key.split("/")
        return any(fits(expression, parts) for expression, _ in self._subscriptions)

    def deliver(self, key: str, payload: bytes, sent_ns: int) -> None:
        """Hand a message that has arrived to every handler that subscribes to its key."""
        handlers = self._handlers.get(key)
        if handlers is None:
            parts = key.split("/")
            handlers = [handler for wanted, handler in self._subscriptions if fits(wanted, parts)]
            self._handlers[key] = handlers
        for handler in handlers:
            if not self._closed:
                handler(key, payload, sent_ns)
