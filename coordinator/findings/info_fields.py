"""The fields of the summary that `splinefleet info` gives of a log or a plan.

Decides: the fields.  Must not know: logs or messages (info.py), or tables (info_table.py).
"""

from __future__ import annotations

import msgspec

from coordinator.findings.giving_way import GivingWay
from coordinator.findings.wait_summary import WaitSummary
from coordinator.plan.document import Proof
from protocol.messages import ORDER_STATES, OrderState


class Traffic(msgspec.Struct):
    """The messages on one key; bytes are of payload, rates are averages over the whole log."""

    messages: int = 0
    bytes: int = 0
    messages_per_second: float = 0.0
    bytes_per_second: float = 0.0


class PhaseChange(msgspec.Struct):
    """A phase, and the time `t` [s] from which the Command stated it."""

    t: float
    phase: str


class EpochSummary(msgspec.Struct):
    """One epoch: its plan's time zero `start` [s], null if it never got a GO; arrivals [s].

    `ended`: "over"; "frozen", while robots were on the way; "arrived", when all that had a part in
    it had arrived but others of the fleet had not; "nobody goes", when no robot could go on, so
    that there was no GO; "running", if the log ends before the epoch does.
    """

    epoch: int
    start: float | None = None
    phases: list[PhaseChange] = []
    arrivals: dict[str, float] = {}
    ended: str = "running"


class StopSummary(msgspec.Struct):
    """A planned rest at arc length s [m] until `depart` [s]."""

    s: float
    depart: float
    yields_to: str


class NearestSummary(msgspec.Struct, frozen=True):
    """The robot that came nearest to one robot, the distance of their centres [m], and when [s].

    `source`: "black boxes", or "plans" if not every robot's black box is known.
    """

    robot: str
    distance: float
    t: float
    source: str


class RobotSummary(msgspec.Struct):
    """One robot: facts of the last course that it drove, and of its messages; times [s].

    `arrived`: when it reported last that it had come to a goal.  `late`: how long after the planned
    finish that was, null while it drives on another course; it may have arrived up to one report
    period before that report.  `reports_lost`: gaps in the sequence numbers of its
    Reports.  `true_arrival` and `tracking_error` [m], the greatest distance from its plans, are
    from its black box.
    """

    plan_bytes: int = 0
    control_points: int = 0
    planned_start: float | None = None
    planned_finish: float | None = None
    stops: list[StopSummary] = []
    arrived: float | None = None
    true_arrival: float | None = None
    late: float | None = None
    tracking_error: float | None = None
    nearest: NearestSummary | None = None
    reports: int = 0
    reports_lost: int = 0
    reports_doubled: int = 0
    bytes_sent: int = 0
    fault: str | None = None


class FaultSummary(msgspec.Struct):
    """Something that went wrong, or a freeze of robots that were under way (kind "freeze").

    Other kinds: "report", a fault that a robot reported; "silence"; "link", a lost link; "refusal";
    "unfit", a robot left behind.
    """

    t: float
    robot: str
    fault: str
    kind: str


class Percentiles(msgspec.Struct, frozen=True):
    """How long something took [s]: in half of `count` cases at most `median`, and so on."""

    count: int
    median: float
    p90: float
    p99: float
    most: float


class HeldSummary(msgspec.Struct, frozen=True):
    """A robot that had to slow down or stand because another was late or lost; times [s].

    It was held from the Command that first granted it less than it needed to be on time, until one
    granted it enough or the fleet froze.
    """

    robot: str
    by: str
    begin: float = msgspec.field(name="from")
    until: float


class OrderSummary(msgspec.Struct, frozen=True):
    """What became of an order; times [s], null for what has not happened or is not known.

    `alone`: the time that its robot would have taken with nobody else on the floor.  `late`: how
    long after the planned arrival the robot was there.
    """

    id: str
    robot: str
    state: str
    released: float | None
    accepted: float | None
    planned_arrival: float | None
    arrived: float | None
    alone: float | None
    reason: str
    late: float | None = None

    @classmethod
    def of(cls, state: OrderState) -> OrderSummary:
        """Return the summary of what a coordinator said last of an order."""

        def seconds(ms: int | None) -> float | None:
            return None if ms is None else ms / 1000.0

        planned, arrived = seconds(state.planned_arrival_ms), seconds(state.arrived_ms)
        return cls(
            state.id,
            state.robot,
            ORDER_STATES[state.state],
            seconds(state.released_ms),
            seconds(state.accepted_ms),
            planned,
            arrived,
            seconds(state.alone_ms),
            state.reason,
            None if planned is None or arrived is None else round(arrived - planned, 3),
        )


class FreezeSummary(msgspec.Struct):
    """A freeze at `t` [s] and how long its parts took [s]; null for what is not in the log.

    `notice`: from the first sign of a fault in the log to FREEZE, null if silence was the sign.
    `silence`: how long the robot that was silent longest had not been heard.  `rest`: from FREEZE
    to the report by which every robot that was still heard was at rest.  `go`: from FREEZE to the
    next GO.
    """

    t: float
    epoch: int
    notice: float | None = None
    silence: float | None = None
    rest: float | None = None
    go: float | None = None


class Broadcast(msgspec.Struct, frozen=True):
    """The fleet's traffic, compared with that of a fleet that broadcasts every robot's position.

    The broadcasting fleet's numbers count deliveries and their payload, as if each robot sent
    `position_bytes` to each other robot `rate` times a second for `seconds`, from the first GO to
    the last arrival.  In our own numbers, a Command counts once for each robot that it reaches.
    """

    robots: int
    seconds: float
    rate: float
    position_bytes: int
    messages: int
    bytes: int
    our_messages: int
    our_bytes: int


class Summary(msgspec.Struct):
    """The whole summary; `duration` [s] of the log, `tau` [s] of its first plan.

    All times count from the GO of the first epoch, which is `zero` [s] after the log's first
    message, or before it in the log of a resumed coordinator.  Without a GO `zero` is null and
    times count from the first message.
    `source`: "log" or "plan"; for a plan, only the fields that a plan has are filled in.  `waits`:
    those of every epoch's plan.  `proof`: that of the last plan.
    `bad_messages`: payloads on the fleet's keys that no receiver accepts.  `dropped`: messages that
    are not in the log, by cause.  `damage`: where the file is not as it was written.  `passive`:
    whether a program that only listened recorded the log.  `version`: of the splinefleet that wrote
    the log; `protocol`: of its messages.  `latencies`: command_age and report_age,
    from the stamp of the coordinator's session to the recording; command_gap, from one Command to
    the next; the parts of the freezes.  `lost_messages`: gaps in the sequence numbers of Reports
    and Commands.
    `robot_payload_bytes_per_second`: what the busiest robot sent, from the first GO to the last
    arrival; null if no robot arrived.
    """

    fleet: str
    policy: str | None
    tau: float | None
    duration: float
    complete: bool
    damage: str
    messages: int
    zero: float | None = None
    source: str = "log"
    passive: bool = False
    version: str | None = None
    protocol: int | None = None
    bad_messages: int = 0
    dropped: dict[str, int] = {}
    lost_messages: int = 0
    positions_on_wire: int = 0
    largest_plan_bytes: int = 0
    largest_message_to_robot_bytes: int = 0
    robot_payload_bytes_per_second: float | None = None
    epochs: list[EpochSummary] = []
    robots: dict[str, RobotSummary] = {}
    faults: list[FaultSummary] = []
    freezes: int = 0
    frozen: list[FreezeSummary] = []
    held: list[HeldSummary] = []
    orders: list[OrderSummary] = []
    latencies: dict[str, Percentiles] = {}
    broadcast: Broadcast | None = None
    waits: list[WaitSummary] = []
    giving_way: list[GivingWay] = []
    proof: Proof | None = None
    keys: dict[str, Traffic] = {}

    def robot(self, name: str) -> RobotSummary:
        """Return what is told of a robot, nothing yet if it is new."""
        return self.robots.setdefault(name, RobotSummary())
