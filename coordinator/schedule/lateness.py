"""A robot that has stopped because it is late: the facts from which new times are planned.

Decides: these facts.  Must not know: paths, plans.
"""

from __future__ import annotations

import msgspec


class Lateness(msgspec.Struct, frozen=True):
    """Who is late, where it stands, and from when on times may change.

    `stood` [s]: the plan time at which the plan has the robot where it stands.  `switch` [s]: the
    plan time before which no robot may get other times.
    """

    robot: str
    stood: float
    switch: float
