"""The messages on the wire as frozen structs, and the numbers inside them.

Decides: the fields, their units, their bounds.  Must not know: how bytes travel, who plans.
Every struct is a msgpack array that begins with its tag; a new field goes last and has a default.
"""

from __future__ import annotations

from typing import Annotated, Final

import msgspec

from protocol.timing import MILLISECOND

PROTOCOL_VERSION: Final = 3

MAX_MESSAGE_BYTES: Final = 4_000
"""No message to a robot may be longer: zenoh-pico drops larger payloads silently."""

MOST_HELD: Final = 120
"""A Command names at most this many robots that have less authority than the others; if there are
more, several Commands speak for a range of numbers each."""

MOST_WANTED: Final = 60
"""A Command asks at most this many robots where they rest, so that it is not too long."""

MOST_VIAS: Final = 50
"""An order names at most this many places to pass."""

FARTHEST: Final = 8_000.0
"""No coordinate [m] is farther from 0, because float32 is coarser than 0.5 mm there."""

MOST_PRIORITY: Final = 2**31 - 1
"""The priority of an order is between this and its negative."""

MOST_NUMBER: Final = 2**32 - 1
"""The greatest number that a course of an epoch can have."""

Counter = Annotated[int, msgspec.Meta(ge=0, le=2**32 - 1)]
Nanoseconds = Annotated[int, msgspec.Meta(ge=-(2**62), le=2**62)]
Duration = Annotated[int, msgspec.Meta(ge=0, le=10**12)]
Milliseconds = Annotated[int, msgspec.Meta(ge=1, le=65_535)]
Offset = Annotated[int, msgspec.Meta(ge=-32_768, le=32_767)]
Place = Annotated[int, msgspec.Meta(ge=-(2**31), le=2**31 - 1)]
PlanTime = Annotated[int, msgspec.Meta(ge=-(2**31), le=2**31 - 1)]
"""A time of the plan [ms]: 0 is its start, which a Command states as start_ns."""
Number = Annotated[int, msgspec.Meta(ge=0, le=MOST_NUMBER)]
Capacity = Annotated[int, msgspec.Meta(ge=0, le=65_535)]
Packed = Annotated[bytes, msgspec.Meta(max_length=3_600)]
RobotId = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.-]{1,32}(?!\n)$")]
Operator = Annotated[str, msgspec.Meta(max_length=64)]
"""Who sends an operator's message, as far as the program that sends it knows; "" if it does not."""


class Hello(msgspec.Struct, frozen=True, array_like=True, tag=1):
    """The message in which a robot introduces itself; repeated until it holds a plan.

    A limit of 0 means "not stated": the robot can do what the scenario asks.  A robot that has come
    back into a fleet under way states in `place` its own estimate of its pose: x, y [mm] and
    heading [mrad].  It does so only while the fleet rests.  `sequence` counts a robot's Hellos from
    1, so that a replayed old one can be recognised; 0: not stated.

    `points`, `stops`, `bytes`: how many control points and stops, and how long a Plan message, the
    robot can hold; 0: not stated.
    """

    version: Annotated[int, msgspec.Meta(ge=0, le=255)]
    boot: Counter
    radius_m: float = 0.0
    max_speed_mps: float = 0.0
    max_accel_mps2: float = 0.0
    place: tuple[Place, Place, Place] | None = None
    sequence: Counter = 0
    points: Capacity = 0
    stops: Capacity = 0
    bytes: Capacity = 0


class Plan(msgspec.Struct, frozen=True, array_like=True, tag=2):
    """One robot's course in one epoch: its path and timetable.

    On the wire a seal is the last element of the array (codec.py).

    `number`: the course's number in this epoch's Commands.  `revision` counts a robot's courses in
    one epoch from 0; `begin_ms` is the plan time at which the course begins.  `tau_ns`: robots keep
    clear while their plan times differ by no more than this; only listeners use it.

    Packed fields are little-endian.  `points`: float32 x, y per control point [m].  `knots`:
    float32, the inner knots and the last one; the first knot is 0 and both ends are clamped.
    `weights`: float32 per control point, empty when all are 1.  `speeds`: the distinct speeds,
    float32 [m/s].  `profile`: float32 s [m] and the uint8 index of its speed per speed knot.
    `stops`: float32 s [m] and int64 departure [ns of plan time] per stop; a robot that brakes
    (`brake_mmps2` > 0) has speed 0 there, which the profile does not repeat.  `clock_ms`: the
    largest error with which the robot may know the coordinator's clock when it arms.
    """

    epoch: Counter
    boot: Counter
    robot: RobotId
    number: Number
    revision: Counter
    begin_ms: PlanTime
    tau_ns: Duration
    track_mm: Annotated[int, msgspec.Meta(ge=0, le=65_535)]
    brake_mmps2: Counter
    clock_ms: Milliseconds
    degree: Annotated[int, msgspec.Meta(ge=1, le=7)]
    points: Packed
    knots: Packed
    weights: Packed
    speeds: Packed
    profile: Packed
    stops: Packed


class Admit(msgspec.Struct, frozen=True, array_like=True, tag=7):
    """An operator's permission for a robot that has come back to take part again.

    `boot` is a number that the operator's program chooses; a Refusal repeats it.
    """

    boot: Counter
    by: Operator = ""


class Refusal(msgspec.Struct, frozen=True, array_like=True, tag=6):
    """The answer, in place of a Plan, to a robot that cannot join; `boot` is that of its Hello.

    Also sent to an operator whose Admit is refused; `boot` is then that of the Admit.
    """

    boot: Counter
    reason: Annotated[str, msgspec.Meta(max_length=200)]


class Command(msgspec.Struct, frozen=True, array_like=True, tag=3):
    """The state that the coordinator commands, repeated every COMMAND_PERIOD.

    A lost Command is harmless, because each one states the whole state (it is level-triggered).
    `term`: who leads; robots obey the highest (term, boot) that they have heard.  `start_ns` is the
    plan's time zero on the coordinator's clock (0 before the first GO), `said_ns` is when the
    Command was sent, on the same clock: the Command's plan time is the difference.

    With GO, courses with a number from `first` to `last` may be driven up to `headroom_ms` beyond
    that plan time, those in `held` (number, plan time) up to the plan time that stands with them.
    A robot keeps the greatest authority that it was granted on a course.  `wanted` names robots at
    rest whose place has not been heard yet.

    `run`: the boot id of the coordinator that began this run of the fleet; one that takes over
    states the same.  A robot under way obeys no other run, whose plans are not its own.
    """

    boot: Counter
    term: Counter
    sequence: Counter
    epoch: Counter
    phase: Annotated[int, msgspec.Meta(ge=0, le=4)]
    start_ns: Nanoseconds
    said_ns: Nanoseconds
    headroom_ms: PlanTime = 0
    held: Annotated[tuple[tuple[Number, PlanTime], ...], msgspec.Meta(max_length=MOST_HELD)] = ()
    first: Number = 0
    last: Number = MOST_NUMBER
    wanted: Annotated[tuple[RobotId, ...], msgspec.Meta(max_length=MOST_WANTED)] = ()
    run: Counter = 0

    def authority_of(self, number: int) -> int | None:
        """Return the plan time [ms] up to which a robot may drive; None if nothing is said."""
        if not self.first <= number <= self.last:
            return None
        for one, time_ms in self.held:
            if one == number:
                return time_ms
        return (self.said_ns - self.start_ns) // MILLISECOND + self.headroom_ms


class Rest(msgspec.Struct, frozen=True, array_like=True):
    """Where a robot rests: arc length on an epoch's path, and the offset from the path there.

    `off_mm`: how far left of the path; `turn_mrad`: heading relative to the path; `beyond_mm`: how
    far past the path's end, negative: before its beginning.  `revision`: which of the epoch's
    courses the path is of.  Sent once, and again when the coordinator asks.
    """

    s_m: Annotated[float, msgspec.Meta(ge=0.0)]
    epoch: Counter
    off_mm: Offset = 0
    turn_mrad: Offset = 0
    beyond_mm: Offset = 0
    revision: Counter = 0


class Report(msgspec.Struct, frozen=True, array_like=True, tag=4):
    """A robot's state, sent on change and every REPORT_PERIOD.

    `epoch` is that of the plan that the robot holds (0: none); an epoch older than the Command's
    requests the new plan.  `rest` says where a robot that has stopped on its way rests; apart from
    `place` of Hello, nothing else on the wire says where a robot is.

    `stamp_ms` is the plan time at which the report was made.  `late` is how far behind its plan the
    robot was then, in steps of LATE_STEP_MS, rounded up: it has passed plan time stamp - late.  A
    robot that does not drive states no stamp.  `revision`: the course that it drives; `holds`: the
    newest course that it holds.
    """

    boot: Counter
    sequence: Counter
    epoch: Counter
    phase: Annotated[int, msgspec.Meta(ge=0, le=5)]
    fault: Annotated[int, msgspec.Meta(ge=0, le=7)] = 0
    rest: Rest | None = None
    stamp_ms: PlanTime | None = None
    late: Annotated[int, msgspec.Meta(ge=0, le=65_535)] = 0
    revision: Counter = 0
    holds: Counter = 0


class Clock(msgspec.Struct, frozen=True, array_like=True, tag=5):
    """The four time stamps of NTP: the robot asks with the first, the answer carries three.

    `sent_ns` is on the robot's clock, `received_ns` and `answered_ns` are on the coordinator's.
    The fourth stamp, the arrival of the answer, is known to the robot only and is not sent.
    `coordinator`: the boot id of the coordinator that answers; 0 in a question.
    """

    boot: Counter
    sent_ns: Nanoseconds
    received_ns: Nanoseconds | None = None
    answered_ns: Nanoseconds | None = None
    coordinator: Counter = 0


OrderId = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.-]{1,32}(?!\n)$")]
Coordinate = Annotated[float, msgspec.Meta(ge=-FARTHEST, le=FARTHEST)]
Spot = tuple[Coordinate, Coordinate]


class Order(msgspec.Struct, frozen=True, array_like=True, tag=10):
    """An operator's order: where a robot is wanted.

    `boot` is a number that the operator's program chooses.  `goal`: x, y [m], and heading [rad] if
    it matters.  `robot`: empty if the coordinator is to choose.  `via`: places [m] to pass, in
    order.  `dwell_ms`: how long the robot stands at the goal before the order is done.  Of orders
    that wait, a higher `priority` goes first.  `now`: the robot leaves what it does for this order.
    It counts from `release_ms` after the first GO on, or when the order `after` is done.  The same
    `id` again is the same order.  If it is that of an order to another goal or for another robot,
    the coordinator answers with that one's id, goal and robot in the same form, and this `boot`.
    """

    boot: Counter
    id: OrderId
    goal: Annotated[tuple[Coordinate, ...], msgspec.Meta(min_length=2, max_length=3)]
    robot: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.-]{0,32}(?!\n)$")] = ""
    via: Annotated[tuple[Spot, ...], msgspec.Meta(max_length=MOST_VIAS)] = ()
    dwell_ms: Counter = 0
    priority: Annotated[int, msgspec.Meta(ge=-(2**31), le=MOST_PRIORITY)] = 0
    now: bool = False
    release_ms: Counter = 0
    after: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.-]{0,32}(?!\n)$")] = ""
    by: Operator = ""


class Cancel(msgspec.Struct, frozen=True, array_like=True, tag=11):
    """An operator takes an order back."""

    boot: Counter
    id: OrderId
    by: Operator = ""


class Tell(msgspec.Struct, frozen=True, array_like=True, tag=12):
    """An operator's word to the fleet: stop at once (0), go on (1), end when all rest (2)."""

    boot: Counter
    what: Annotated[int, msgspec.Meta(ge=0, le=2)]
    by: Operator = ""


HALT, GO_ON, END = range(3)
"""What a Tell may say."""


class Block(msgspec.Struct, frozen=True, array_like=True, tag=14):
    """An operator closes a place for all robots that have not passed it: a polygon [m].

    The coordinator states the places that are closed in the same form.
    """

    boot: Counter
    id: OrderId
    polygon: Annotated[tuple[Spot, ...], msgspec.Meta(min_length=3, max_length=100)]
    by: Operator = ""


class Unblock(msgspec.Struct, frozen=True, array_like=True, tag=15):
    """An operator opens a place that was closed."""

    boot: Counter
    id: OrderId
    by: Operator = ""


LEAST_ACCEL: Final = 0.001
"""A robot that joins with a lower acceleration [m/s^2] would never get away."""


class Join(msgspec.Struct, frozen=True, array_like=True, tag=16):
    """An operator takes a robot into the fleet: where it stands (x, y [m], heading [rad]).

    `max_accel_mps2`: 0 for a robot that reaches its greatest speed within a second.  The answer is
    the state of the order `join-ROBOT`.
    """

    boot: Counter
    robot: RobotId
    place: tuple[Coordinate, Coordinate, Coordinate]
    radius_m: Annotated[float, msgspec.Meta(ge=0.001, le=100.0)]
    max_speed_mps: Annotated[float, msgspec.Meta(ge=0.001, le=100.0)]
    max_accel_mps2: Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)] = 0.0
    min_turn_radius_m: Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)] = 0.0
    max_turn_rate: Annotated[float, msgspec.Meta(ge=0.001, le=1000.0)] = 2.0
    by: Operator = ""


class Leave(msgspec.Struct, frozen=True, array_like=True, tag=17):
    """An operator takes a robot that rests, or is lost, out of the fleet.

    The answer is the state of the order `leave-ROBOT`.
    """

    boot: Counter
    robot: RobotId
    by: Operator = ""


class OrderState(msgspec.Struct, frozen=True, array_like=True, tag=13):
    """What became of an order; `state` counts in ORDER_STATES, times are in ms since the first GO.

    `robot`: who does it, empty until one is chosen.  `alone_ms`: the time that its robot would take
    with nobody else on the floor.  `reason`: for whom it waits, or why it was refused or cancelled.
    """

    id: Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9_.-]{1,38}(?!\n)$")]
    state: Annotated[int, msgspec.Meta(ge=0, le=4)]
    robot: str = ""
    released_ms: int | None = None
    accepted_ms: int | None = None
    planned_arrival_ms: int | None = None
    arrived_ms: int | None = None
    alone_ms: int | None = None
    reason: Annotated[str, msgspec.Meta(max_length=300)] = ""


ORDER_STATES: Final = ("waiting", "under way", "done", "cancelled", "refused")
WAITING, UNDER_WAY, ORDER_DONE, CANCELLED, REFUSED = range(5)

Operators = Admit | Order | Cancel | Tell | Block | Unblock | Join | Leave
"""What operators send."""

Message = Hello | Plan | Refusal | Command | Report | Clock | OrderState | Operators
