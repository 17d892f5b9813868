"""What a robot can hold of a Plan, as its Hello states it, compared with the Plan made for it.

Decides: whether a Plan is too large for a robot, and the words that say so.  Must not know: fleets,
how courses are found.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from protocol.codec import decode
from protocol.messages import Hello, Plan
from protocol.plan_bytes import unpack_points, unpack_stops

_WHAT: Final = ("control points", "stops", "bytes")


class Capacity(NamedTuple):
    """The most control points, stops and bytes of a Plan that a robot can hold; 0: not stated."""

    points: int = 0
    stops: int = 0
    size: int = 0

    @classmethod
    def of(cls, hello: Hello) -> Capacity:
        """Return what a robot's Hello states."""
        return cls(hello.points, hello.stops, hello.bytes)

    def objection(self, payload: bytes) -> str:
        """Return what makes an encoded Plan too large for the robot, or an empty text."""
        plan = decode("plan", payload) if any(self) else None
        if not isinstance(plan, Plan):
            return ""
        points, stops = unpack_points(plan.points), unpack_stops(plan.stops)
        needed = (len(points), len(stops), len(payload))
        over = [
            f"{count} {what}, it holds {most}"
            for what, count, most in zip(_WHAT, needed, self, strict=True)
            if 0 < most < count
        ]
        return f"cannot hold its course: {'; '.join(over)}" if over else ""


UNLIMITED: Final = Capacity()
"""The capacity of a robot that states none."""
