"""A robot that has come back, and what operators ask of it.

Decides: whether it is at the door, since when it is waited for to say where it stands, and who
asked for that in vain.  Must not know: what the robot did before, the fleet.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from protocol.messages import Hello

ASKERS: Final = 64
"""Of so many who asked it is remembered."""

_MOST_GONE: Final = 2
"""A robot that is gone again so often while it is waited for is not waited for again."""


@dataclass
class Admission:
    """One robot's coming back; who asks is known by the boot id of its Admit."""

    hello: Hello | None = None
    """The last one of a robot that has come back."""
    heard_ns: int | None = None
    """When it was heard; None when its link has gone since."""
    since_ns: int | None = None
    """Since when the robot is waited for to say where it stands; None: it is not."""
    asked_by: dict[int, int] = field(default_factory=dict)
    """Who asked for it the last time that it was waited for, until an epoch begins without it."""
    in_vain: dict[int, int] = field(default_factory=dict)
    """Who asked for it when it then did not say where it stands, or was gone again so often."""

    @property
    def is_awaited(self) -> bool:
        """Tell whether the robot may take part as soon as it says where it stands."""
        return self.since_ns is not None

    def knock(self, hello: Hello, now_ns: int) -> None:
        """Take note that the robot is back, which it says again and again."""
        self.hello, self.heard_ns = hello, now_ns

    def leave(self) -> None:
        """Take note that the link to the robot is gone."""
        self.heard_ns = None

    def is_at_door(self, timeout_ns: int, now_ns: int) -> bool:
        """Tell whether a robot that has come back is there: it is heard."""
        return self.heard_ns is not None and now_ns - self.heard_ns <= timeout_ns

    def ask(self, boot: int, now_ns: int) -> bool:
        """Wait for the robot; tell whether that begins."""
        begins = not self.is_awaited
        if begins:
            self.since_ns = now_ns
            self.asked_by.clear()
        _count(self.asked_by, boot)
        return begins

    def join(self, boot: int) -> bool:
        """Take note of one more who asks for a robot that was taken in; False when nobody did."""
        if self.asked_by:
            _count(self.asked_by, boot)
        return bool(self.asked_by)

    def take_in(self) -> None:
        """Wait no more: the robot has said where it stands."""
        self.since_ns = None

    def look(self, timeout_ns: int, patience_ns: int | None, now_ns: int) -> None:
        """Give up a robot that is gone again, or does not say for so long where it stands."""
        if self.since_ns is None:
            return
        is_gone = not self.is_at_door(timeout_ns, now_ns)
        if is_gone or (patience_ns is not None and now_ns - self.since_ns > patience_ns):
            self.since_ns = None
            for boot in self.asked_by:
                _count(self.in_vain, boot, 1 if is_gone else _MOST_GONE)

    def refuses(self, boot: int) -> bool:
        """Tell whether somebody has asked in vain: the fleet does not freeze for them again."""
        return self.in_vain.get(boot, 0) >= _MOST_GONE

    def end(self) -> None:
        """Take note that an epoch begins without the robot: what was asked for is settled."""
        self.since_ns = None
        self.asked_by.clear()


def _count(boots: dict[int, int], boot: int, by: int = 1) -> None:
    boots[boot] = boots.pop(boot, 0) + by
    if len(boots) > ASKERS:
        del boots[next(iter(boots))]
