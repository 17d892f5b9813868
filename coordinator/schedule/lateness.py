"""A robot that stands because it is late: what new times for its fleet start from.

Decides: these facts.  Must not know: paths, plans.
"""

from __future__ import annotations

import msgspec


class Lateness(msgspec.Struct, frozen=True):
    """Who stands late, which plan time [s] has it there, and from when on times may change [s]."""

    robot: str
    stood: float
    switch: float
