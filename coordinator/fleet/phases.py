"""The fleet's phases, the events that lead from one to the next, and how long each may last.

Decides: which events change a phase.  Must not know: when an event happens (core.py).
"""

from __future__ import annotations

from typing import Final, Literal

from protocol.phases import FREEZE, GO, HOLD, OVER, STOP
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND

GO_LEAD: Final = 400 * MILLISECOND
"""Time from the decision to go until the common start, enough for every robot to hear of it."""

AWAY: Final = 2 * COMMAND_PERIOD
"""A coordinator that has not looked at the time for longer than this was away: it heard nobody."""

HELD_PATIENCE: Final = 5 * SECOND
"""How long a robot that is lost or does not get on may hold others before those go around it."""

SILENT_PATIENCE: Final = 10 * SECOND
"""The same for robots that are silent although no link is known to be gone: they may be heard
again."""

FREEZE_PATIENCE: Final = 10 * SECOND
"""How long the fleet waits for a frozen robot to say where it stands; then the robot is lost."""

ARM_PATIENCE: Final = 10 * SECOND
"""How long the fleet waits for a robot to arm after the first epoch; then it gets a strike."""

RESUME_PATIENCE: Final = 5 * SECOND
"""How long robots have to be heard again after the coordinator resumed or the router came back."""

LINKS_PATIENCE: Final = 60 * SECOND
"""How long a coordinator that resumed and hears nobody at all waits for the first robot: on a slow
machine, links take long to be made."""

RETURN_PATIENCE: Final = 2 * SECOND
"""How long robots have to be heard again after the coordinator was away for over REPORT_TIMEOUT."""

LONGEST_EPOCH: Final = 900_000 * SECOND
"""After so long, ten days, a fleet is planned anew, and plan time begins again: robots take no
course that ends after 10^6 s."""

FAREWELLS: Final = 5
"""How many Commands with OVER are sent."""

Event = Literal[
    "all armed",
    "robot failed",
    "all done",
    "some can go on",
    "planned",
    "none can go",
    "admitted",
    "floor changed",
    "told to stop",
    "told to go on",
]

TRANSITIONS: Final[dict[tuple[int, Event], int]] = {
    (HOLD, "all armed"): GO,
    (HOLD, "robot failed"): FREEZE,
    (HOLD, "admitted"): FREEZE,
    (GO, "all done"): OVER,
    (GO, "some can go on"): FREEZE,
    (GO, "admitted"): FREEZE,
    (HOLD, "floor changed"): FREEZE,
    (GO, "floor changed"): FREEZE,
    (STOP, "floor changed"): FREEZE,
    (GO, "told to stop"): STOP,
    (STOP, "told to go on"): GO,
    (FREEZE, "planned"): HOLD,
    (FREEZE, "none can go"): OVER,
}
