"""What is told about a log or a plan: the fields of `splinefleet info`.

Decides: the fields.  Must not know: logs or messages (info.py), or tables (info_table.py).
"""

from __future__ import annotations

import msgspec

from coordinator.plan import Proof
from coordinator.wait_summary import WaitSummary


class Traffic(msgspec.Struct):
    """What went over one key; payload bytes."""

    messages: int = 0
    bytes: int = 0


class PhaseChange(msgspec.Struct):
    """From `t` [s] on the Command stated this phase."""

    t: float
    phase: str


class EpochSummary(msgspec.Struct):
    """One epoch: its plan's time zero `start` [s], null if it never got a GO; arrivals [s]."""

    epoch: int
    start: float | None = None
    phases: list[PhaseChange] = []
    arrivals: dict[str, float] = {}
    ended: str = "running"


class StopSummary(msgspec.Struct):
    """A planned rest at arc length s [m] until plan time `depart` [s]."""

    s: float
    depart: float
    yields_to: str


class RobotSummary(msgspec.Struct):
    """One robot: plan from the last plan that names it, the rest from the wire; times [s]."""

    plan_bytes: int = 0
    control_points: int = 0
    planned_start: float | None = None
    planned_finish: float | None = None
    stops: list[StopSummary] = []
    arrived: float | None = None
    reports: int = 0
    bytes_sent: int = 0
    fault: str | None = None


class FaultSummary(msgspec.Struct):
    """A fault that a robot reported (kind "report") or a freeze of the fleet (kind "freeze")."""

    t: float
    robot: str
    fault: str
    kind: str


class Summary(msgspec.Struct):
    """The whole; `duration` [s] of the log, `tau` [s] of its first plan.

    `source`: "log" or "plan"; of a plan nothing but its own fields is known.  `waits`: of every
    epoch's plan, `proof`: of the last one.
    `bad_messages`: payloads on the fleet's keys that no receiver accepts.  `damage`: where the
    file is not as it was written.  `robot_payload_bytes_per_second`: of the busiest robot, from
    the first GO to the last arrival, null when there was none.
    """

    fleet: str
    policy: str | None
    tau: float | None
    duration: float
    complete: bool
    damage: str
    messages: int
    source: str = "log"
    bad_messages: int = 0
    positions_on_wire: int = 0
    largest_plan_bytes: int = 0
    largest_message_to_robot_bytes: int = 0
    robot_payload_bytes_per_second: float | None = None
    epochs: list[EpochSummary] = []
    robots: dict[str, RobotSummary] = {}
    faults: list[FaultSummary] = []
    waits: list[WaitSummary] = []
    proof: Proof | None = None
    keys: dict[str, Traffic] = {}
