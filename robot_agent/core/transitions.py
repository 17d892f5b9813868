"""The robot's phases and the events that lead from one to another, as one table.

Decides: which events change a phase.  Must not know: when an event happens (agent.py).
"""

from protocol.phases import ARMED, BRAKING, DONE, FROZEN, IDLE, MOVING

READY = "ready"
NOT_READY = "not ready any more"
GO = "go"
TOLD_TO_FREEZE = "told to freeze"
NEW_EPOCH = "new epoch"
TROUBLE = "trouble"
AT_REST = "at rest"
ARRIVED = "arrived"
LEFT_PATH = "left its path"
NEW_COURSE = "new course"

TRANSITIONS = {
    (IDLE, READY): ARMED,
    (IDLE, NEW_EPOCH): IDLE,
    (ARMED, NOT_READY): IDLE,
    (ARMED, GO): MOVING,
    (ARMED, TOLD_TO_FREEZE): FROZEN,
    (ARMED, TROUBLE): FROZEN,
    (ARMED, NEW_EPOCH): IDLE,
    (MOVING, TOLD_TO_FREEZE): BRAKING,
    (MOVING, TROUBLE): BRAKING,
    (MOVING, NEW_EPOCH): BRAKING,
    (MOVING, ARRIVED): DONE,
    (MOVING, LEFT_PATH): BRAKING,
    (BRAKING, AT_REST): FROZEN,
    (BRAKING, ARRIVED): DONE,
    (FROZEN, NEW_EPOCH): IDLE,
    (DONE, NEW_EPOCH): IDLE,
    (DONE, NEW_COURSE): MOVING,
    (DONE, LEFT_PATH): BRAKING,
    (FROZEN, NEW_COURSE): MOVING,
}
"""(phase, event) -> phase; an event that is not listed for a phase leaves it unchanged."""
