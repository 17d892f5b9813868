"""The robot's mind: what it hears, what it does, what it says; a state machine without I/O.

Decides: phases, faults, speeds, when to report and what.  Must not know: bytes, links, files, or
any clock but the `now_ns` it is given (the robot's own, monotonic).  Firmware: imports nothing but
`math`, the shared numbers and its two helpers; `tick` allocates nothing that stays.

The rules:
- A robot moves only in the epoch of the plan it holds, after GO, and only along that plan: never
  ahead of it, and behind it by less than its share of tau.
- Whatever goes wrong while it moves makes it brake along its path and freeze.  A robot that has
  braked moves again only with the plan of a later epoch.
- A Command older than the last one heard changes nothing.  Another coordinator (boot) is believed
  before motion, or when its epoch is higher; it takes the plan and the clock of the old one away.
- A plan is held when it is for the newest epoch heard and the robot is idle.  The robot arms when
  it also stands at the plan's start and knows the time well enough; until then it says why not.
- GO heard when the plan has already run away is not obeyed: the robot stays where it is.
- A robot at its goal stays there in that epoch, whatever it hears.
- A position is never said, but for the arc length at which a frozen robot rests: in the first
  report that says it is frozen, and again when the coordinator asks for it.
"""

from protocol.curve import Curve
from protocol.phases import (
    ARMED,
    BAD_PLAN,
    BRAKING,
    CLOCK_UNSURE,
    DONE,
    DRIVER_ERROR,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    IDLE,
    LATE,
    LEASE_OUT,
    MOVING,
    NO_FAULT,
    OFF_PATH,
    OVER,
)
from protocol.timeline import Timeline
from protocol.timing import (
    CLOCK_ERROR,
    CLOCK_PERIOD,
    CLOCK_PERIOD_FAST,
    CLOCK_SAMPLES,
    HELLO_PERIOD,
    LEASE,
    MILLISECOND,
    REPORT_PERIOD,
    SECOND,
)
from robot_agent.clock_sync import ClockSync
from robot_agent.steering import PathFollower

READY = "ready"
GO_IN_TIME = "go in time"
GO_TOO_LATE = "go too late"
TOLD_TO_FREEZE = "told to freeze"
NEW_EPOCH = "new epoch"
TROUBLE = "trouble"
AT_REST = "at rest"
ARRIVED = "arrived"

TRANSITIONS = {
    (IDLE, READY): ARMED,
    (IDLE, NEW_EPOCH): IDLE,
    (ARMED, GO_IN_TIME): MOVING,
    (ARMED, GO_TOO_LATE): FROZEN,
    (ARMED, TOLD_TO_FREEZE): FROZEN,
    (ARMED, TROUBLE): FROZEN,
    (ARMED, NEW_EPOCH): IDLE,
    (MOVING, TOLD_TO_FREEZE): BRAKING,
    (MOVING, TROUBLE): BRAKING,
    (MOVING, NEW_EPOCH): BRAKING,
    (MOVING, ARRIVED): DONE,
    (BRAKING, AT_REST): FROZEN,
    (FROZEN, NEW_EPOCH): IDLE,
    (DONE, NEW_EPOCH): IDLE,
}
"""(phase, event) -> phase; whatever does not stand here changes nothing."""

ARRIVAL_SLACK = 1e-3
"""How near [m] to its goal a robot has arrived, and how far behind still counts as in time."""

HOLD_OUT = 0.05
"""For how long [s] an order to the driver lasts, should the next tick not come."""

REST_NS = 60 * MILLISECOND
"""A robot that has not moved by a millimetre for this long, at speed 0, rests."""

_CATCH_UP_RATE = 20.0
_SPARE_SPEED = 1.05
_NEVER = -(1 << 62)


class Agent:
    """One robot.  `boot` names this life of it; `max_speed` [m/s], 0 when it is not known.

    Read after `tick`: drive_speed [m/s], drive_curvature [rad/m], drive_distance [m].
    Read after `report_due`: report_sequence, epoch, phase, fault and report_s [m] or None.
    """

    def __init__(self, boot: int, max_speed: float = 0.0, period_ns: int = 10 * MILLISECOND) -> None:
        self.clock = ClockSync()
        self.phase = IDLE
        self.fault = NO_FAULT
        self.epoch = 0
        self.finished = False
        self.follower: PathFollower | None = None
        self.drive_speed = self.drive_curvature = self.drive_distance = 0.0
        self.report_sequence = 0
        self.report_s: float | None = None
        self._boot = boot
        self._max_speed = max_speed
        self._speed_limit = max_speed
        self._period = period_ns / SECOND
        self._coordinator = self._sequence = -1
        self._command_epoch = self._spent_epoch = self._start_ns = 0
        self._command_ns = _NEVER
        self._timeline: Timeline | None = None
        self._late = self._track = self._brake = 0.0
        self._lease_ns = LEASE
        self._brake_ns = self._rest_ns = 0
        self._brake_speed = self._rest_x = self._rest_y = 0.0
        self._tell_s = False
        self._reported = (-1, -1, -1)
        self._reported_ns = self._hello_ns = self._asked_ns = _NEVER
