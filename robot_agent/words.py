"""What a robot prints for the person who started it: its phase, what it waits for, and why.

Decides: the words, and that a lasting reason is printed once.  Must not know: links, consoles,
or anything that makes a robot move.
"""

from __future__ import annotations

from typing import Final

from protocol.phases import (
    BRAKING,
    DRIVER_ERROR,
    FROZEN,
    HOLD,
    IDLE,
    MOVING,
    NO_FAULT,
    OFF_PATH,
    PHASE_NAMES,
    fault_name,
)
from protocol.timing import SECOND
from robot_agent.core.agent import Agent
from robot_agent.driver import Pose

SOMEWHERE = "--connect ..."
"""The option of commands in texts that do not know where the fleet is reached."""

PATIENCE_NS = SECOND
_STANDS: Final = 1e-3
"""A robot that is to drive slower than this [m/s] stands."""

DEAF = "hears no coordinator, stops where its authority ends"
ANEW = (
    "hears a coordinator that began anew, and waits for one that goes on from the log (--resume); "
    "to take part in the new run, start this program again"
)
HEARS_AGAIN = "hears its coordinator again"
HELD = "stands where its authority ends: somebody is in its way, or a place is closed"
STOPPED = "stands: the fleet is stopped"
GOES_ON = "drives on"


class Lasting:
    """A filter that returns a text once, when it has stayed the same for PATIENCE_NS.

    The text after a colon is not compared, because measured positions in it vary.
    """

    def __init__(self) -> None:
        self._reason = self._told = ""
        self._since_ns = 0

    def hear(self, text: str, now_ns: int) -> str:
        """Return the text when it is to be printed now, else an empty text."""
        reason = text.partition(":")[0]
        if reason != self._reason:
            self._reason, self._since_ns = reason, now_ns
        if reason == self._told or now_ns - self._since_ns < PATIENCE_NS:
            return ""
        self._told = reason
        return text


class Trouble:
    """What keeps a robot under way from driving on, in words, and that this has ended."""

    def __init__(self) -> None:
        self._now = self._lasted = ""
        self._since_ns = 0

    def forget(self) -> None:
        """Take in that the robot is not under way any more."""
        self._now = self._lasted = ""

    def hear(self, agent: Agent, heard: bool, stopped: bool, now_ns: int) -> str:
        """Return what keeps the robot, or that what kept it for long does not any more, or "".

        `heard`: whether its coordinator is heard; `stopped`: whether that has stopped the fleet.
        """
        now = ""
        if not heard and (self._lasted == DEAF or agent.phase in (MOVING, BRAKING)):
            now = DEAF
        elif agent.phase == MOVING and agent.drive_speed < _STANDS and stopped:
            now = STOPPED
        elif agent.phase == MOVING and agent.drive_speed < _STANDS:
            now = HELD if agent.report_late > 0 or self._now == HELD else ""
        if now != self._now:
            self._now, self._since_ns = now, now_ns
        if now and now_ns - self._since_ns >= PATIENCE_NS:
            self._lasted = now
        if now or self._lasted == DEAF:
            return now or HEARS_AGAIN
        return GOES_ON if self._lasted in (HELD, STOPPED) and agent.phase == MOVING else ""


def phase_in_words(agent: Agent, error: str) -> str:
    """Return a robot's phase, and why it stopped if it did; `error`: what last went wrong."""
    text = PHASE_NAMES[agent.phase]
    if agent.fault != NO_FAULT and agent.phase != IDLE:
        text += f", {fault_name(agent.fault)}"
        if agent.fault == DRIVER_ERROR and error:
            text += f" ({error})"
    return f"{text}, waiting for a new plan" if agent.phase == FROZEN else text


def waits_for(
    agent: Agent,
    robot: str,
    fleet: str | None,
    phase: int,
    heard: bool,
    pose: Pose | None,
    arrived: bool = False,
) -> str:
    """Return what keeps an idle robot from being armed; empty when nothing does.

    `phase` is the fleet's phase; `heard`: whether its coordinator is heard; `pose`: the robot's own
    estimate of its pose; `arrived`: whether it was at its goal when the fleet's last epoch ended.
    """
    if fleet is None:
        return "hears no coordinator"
    if not heard:
        return f"hears no coordinator of fleet {fleet}"
    if agent.fault == OFF_PATH and agent.ride is not None and pose is not None:
        begins = _place(agent.ride.follower.start_pose())
        return f"does not arm, {fault_name(OFF_PATH)}: stands at {_place(pose)}, not at {begins}"
    if agent.fault != NO_FAULT:
        return f"does not arm, {fault_name(agent.fault)}"
    if agent.ride is not None:
        return ""
    if arrived:
        return f"has arrived, fleet {fleet} goes on without it"
    if agent.has_driven() and phase != HOLD:
        return f"has no part in this epoch of fleet {fleet}, stays where it stands"
    if phase == HOLD:
        return f"has said hello to fleet {fleet}, which has sent no plan yet"
    x, y, heading = ("X", "Y", "HEADING") if pose is None else (f"{one:.3f}" for one in pose)
    join = f"`splinefleet join {robot} --at {x},{y},{heading} {SOMEWHERE}` takes in a new robot"
    admit = f"`splinefleet admit {robot} {SOMEWHERE}` lets in one that was there before"
    if pose is None:
        admit += ", after a start with --at X Y HEADING"
    return f"fleet {fleet} is under way without it; {join}, {admit}"


def _place(pose: Pose) -> str:
    return f"({pose[0]:.3f}, {pose[1]:.3f})"
