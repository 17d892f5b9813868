"""The fleet's phases, the events that lead from one to the next, and how long each may last.

Decides: which events change a phase.  Must not know: when an event happens (core.py).
"""

from __future__ import annotations

from typing import Final, Literal

from protocol.phases import FREEZE, GO, HOLD, OVER
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND

GO_LEAD: Final = 400 * MILLISECOND
"""Time from the decision to go until the common start, enough for every robot to hear of it."""

TASK_GRACE: Final = 10 * SECOND
"""Time after the last planned arrival by which all robots must have arrived."""

FREEZE_PATIENCE: Final = 10 * SECOND
"""How long the fleet waits for a frozen robot to say where it stands; then the robot is lost."""

ARM_PATIENCE: Final = 10 * SECOND
"""How long the fleet waits for a robot to arm after the first epoch; then it gets a strike."""

RESUME_PATIENCE: Final = 5 * SECOND
"""How long robots have to find a coordinator that has resumed from a log."""

UNLOGGED: Final = 2 * COMMAND_PERIOD
"""How long a coordinator may have gone on after the last record in its log."""

FAREWELLS: Final = 5
"""How many Commands with OVER are sent."""

Event = Literal[
    "all armed", "robot failed", "all done", "some can go on", "planned", "none can go", "admitted"
]

TRANSITIONS: Final[dict[tuple[int, Event], int]] = {
    (HOLD, "all armed"): GO,
    (HOLD, "robot failed"): FREEZE,
    (GO, "robot failed"): FREEZE,
    (GO, "all done"): OVER,
    (GO, "some can go on"): FREEZE,
    (GO, "admitted"): FREEZE,
    (HOLD, "admitted"): FREEZE,
    (FREEZE, "planned"): HOLD,
    (FREEZE, "none can go"): OVER,
}
