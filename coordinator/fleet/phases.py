"""The fleet's phases, what leads from one to the next, and how long each is borne.

Decides: which events change a phase.  Must not know: when an event happens (core.py).
"""

from __future__ import annotations

from typing import Final, Literal

from protocol.phases import FREEZE, GO, HOLD, OVER
from protocol.timing import COMMAND_PERIOD, MILLISECOND, SECOND

GO_LEAD: Final = 400 * MILLISECOND
"""From the decision to go until the common start: every robot hears of it in time."""

TASK_GRACE: Final = 10 * SECOND
"""A fleet that has not arrived this long after its last planned arrival has a lost robot."""

FREEZE_PATIENCE: Final = 10 * SECOND
"""How long a frozen robot is waited for to tell where it stands; then it is not fit."""

ARM_PATIENCE: Final = 10 * SECOND
"""How long a robot is waited for to arm in a later epoch; then it is not fit."""

RESUME_PATIENCE: Final = 5 * SECOND
"""How long robots have to find a coordinator that goes on from a log."""

UNLOGGED: Final = 2 * COMMAND_PERIOD
"""So long a coordinator may have gone on after the last record that its log kept."""

FAREWELLS: Final = 5
"""How often OVER is said."""

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
