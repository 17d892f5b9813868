"""A robot that has come back, and the operators' requests to admit it.

Decides: whether the robot is still heard, how long the fleet has waited for it to say where it
stands, and whose requests were in vain.  Must not know: what the robot did before, the fleet.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from protocol.messages import Hello

ASKERS: Final = 64
"""How many operators' requests are remembered, each by its boot id."""

_MOST_GONE: Final = 2
"""How often the robot may be gone again before the fleet no longer waits for the same request."""


@dataclass
class Admission:
    """One robot's return; a request is known by the boot id in its Admit messages."""

    hello: Hello | None = None
    """The newest Hello of a robot that has come back."""
    heard_ns: int | None = None
    """When that Hello was heard [ns]; None if the robot's link has gone since."""
    since_ns: int | None = None
    """Since when the fleet waits for the robot to say where it stands [ns]; None if it does not."""
    asked_by: dict[int, int] = field(default_factory=dict)
    """How often each boot id asked since the fleet last began to wait for the robot.

    Cleared when an epoch begins without the robot."""
    in_vain: dict[int, int] = field(default_factory=dict)
    """How often each boot id asked in vain.

    A request counts once if the robot was gone again, and _MOST_GONE times if the robot did not say
    where it stands, or cannot stand there."""
    turned_away: str = ""
    """Why the robot cannot stand where it said, in words; "" if it did not say so."""

    @property
    def is_awaited(self) -> bool:
        """Whether the robot takes part as soon as it says where it stands."""
        return self.since_ns is not None

    def knock(self, hello: Hello, now_ns: int) -> None:
        """Record a Hello of the robot that has come back; it repeats its Hello."""
        self.hello, self.heard_ns = hello, now_ns

    def leave(self) -> None:
        """Record that the link to the robot is gone."""
        self.heard_ns = None

    def is_at_door(self, timeout_ns: int, now_ns: int) -> bool:
        """Return whether a robot that has come back is still heard."""
        return self.heard_ns is not None and now_ns - self.heard_ns <= timeout_ns

    def ask(self, boot: int, now_ns: int) -> bool:
        """Record a request and wait for the robot; return whether the wait begins with it."""
        begins = not self.is_awaited
        if begins:
            self.since_ns, self.turned_away = now_ns, ""
            self.asked_by.clear()
        _count(self.asked_by, boot)
        return begins

    def join(self, boot: int) -> bool:
        """Record a further request if the robot was requested before; return whether it was."""
        if self.asked_by:
            _count(self.asked_by, boot)
        return bool(self.asked_by)

    def take_in(self) -> None:
        """End the wait, because the robot has said where it stands."""
        self.since_ns = None

    def turn_away(self, why: str) -> None:
        """End the wait, because the robot cannot stand where it says; all requests were in vain."""
        self.since_ns, self.turned_away = None, why
        for boot in self.asked_by:
            _count(self.in_vain, boot, _MOST_GONE)

    def look(self, timeout_ns: int, patience_ns: int | None, now_ns: int) -> None:
        """End the wait if the robot is gone again, or has not said in time where it stands."""
        if self.since_ns is None:
            return
        is_gone = not self.is_at_door(timeout_ns, now_ns)
        if is_gone or (patience_ns is not None and now_ns - self.since_ns > patience_ns):
            self.since_ns = None
            for boot in self.asked_by:
                _count(self.in_vain, boot, 1 if is_gone else _MOST_GONE)

    def refuses(self, boot: int) -> bool:
        """Return whether a request was in vain, so that the fleet does not freeze for it again."""
        return self.in_vain.get(boot, 0) >= _MOST_GONE

    def end(self) -> None:
        """Record that an epoch begins without the robot, which settles all requests."""
        self.since_ns = None
        self.asked_by.clear()


def _count(boots: dict[int, int], boot: int, by: int = 1) -> None:
    boots[boot] = boots.pop(boot, 0) + by
    if len(boots) > ASKERS:
        del boots[next(iter(boots))]
