"""One robot in virtual time: its service, its body, its own clock, and its true motion.

Decides: what a robot that is dead or hangs still does, and which rows are recorded.  Must not know:
other robots, and when a fault is due (virtual_fleet.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from protocol.phases import PHASE_NAMES
from protocol.timing import MILLISECOND, SECOND
from robot_agent.driver import DriverError, Pose
from robot_agent.service import RobotService
from sim.judging.blackbox import BlackBox, Row
from sim.world.failing_body import FailingBody
from sim.world.robot_clock import RobotClock

_AWAKE: Final = -(1 << 62)
_SAME_ERROR: Final = MILLISECOND / SECOND
"""Clock errors that differ by less [s] count as the same."""


@dataclass(eq=False)
class Inhabitant:
    """A robot; `clock` is its own clock as its program reads it.

    rows: the rows of its black box, with t in virtual time [s since the first GO].  There is one
    for each row_period_ns and for each change of phase; of those while a robot stands with an
    unchanged clock error, only the first and the last are kept.
    """

    service: RobotService
    body: FailingBody
    own_clock: RobotClock
    clock: Callable[[], int]
    dead: bool = False
    hung: bool = False
    row_period_ns: int = 1
    rows: list[Row] = field(default_factory=list)
    _row_number: int = -1
    _own_ns: int = 0
    _quiet_until_ns: int = _AWAKE
    _quiet_pose: Pose | None = None

    def run(self, service: RobotService) -> None:
        """Let the robot run another program."""
        self.service, self._quiet_until_ns = service, _AWAKE

    def tick(self) -> None:
        """Let one control period pass; without a running program the watchdog stops the motors."""
        own_ns = self._own_ns = self.clock()
        if self.dead or self.hung:
            self.body.step(own_ns)
            return
        if own_ns < self._quiet_until_ns and self._rests_on(own_ns):
            return
        service = self.service
        self._quiet_until_ns = _AWAKE
        try:
            service.tick(own_ns)
            if not self.body.speed and self.body.is_still():
                self._quiet_until_ns = service.agent.quiet_until(own_ns)
                self._quiet_pose = self.body.true_pose()
        except DriverError as error:
            self.body.stop()
            self.service.rescue(error, own_ns)

    def _rests_on(self, own_ns: int) -> bool:
        """Skip a tick of a robot that rests, because it would change nothing; False if it may."""
        body, service = self.body, self.service
        if not body.is_still() or body.true_pose() != self._quiet_pose:
            return False
        return service.inbox.is_empty() and service.agent.skip(own_ns)

    def note(self, now_ns: int, began_ns: int) -> None:
        """Record the body's true pose if a row is due, right after `tick`.

        `began_ns` is the virtual time of the first GO.
        """
        pose, service, rows = self.body.true_pose(), self.service, self.rows
        number, phase = (now_ns - began_ns) // self.row_period_ns, PHASE_NAMES[service.agent.phase]
        if pose is None or (number == self._row_number and rows[-1][5] == phase):
            return
        self._row_number = number
        agent, t = service.agent, (now_ns - began_ns) / SECOND
        ride, estimate = agent.ride, None
        s = ride.follower.s if ride is not None else 0.0
        if not (self.dead or self.hung):
            estimate_ns = service.coordinator_time(self._own_ns)
            if estimate_ns is not None:
                estimate = (estimate_ns - began_ns) / SECOND
        row = (t, *pose, s, phase, estimate)
        has_stood = len(rows) > 1 and rows[-1][1] == pose[0] and rows[-2][1] == pose[0]
        if has_stood and _is_alike(rows[-1], row) and _is_alike(rows[-2], row):
            rows[-1] = row
        else:
            rows.append(row)

    def written_rows(self) -> list[Row]:
        """Return the rows, without the last one if a dead or hung program could not write it.

        Such a program writes no rows, and its body has come to rest.
        """
        rows = self.rows
        if (self.dead or self.hung) and len(rows) > 1 and rows[-1][1:6] == rows[-2][1:6]:
            return rows[:-1]
        return rows

    def blackbox(self) -> BlackBox:
        """Return the recorded rows as a black box."""
        numbers = np.array([row[:5] for row in self.rows]).reshape(-1, 5)
        phases = tuple(row[5] for row in self.rows)
        estimates = np.array([row[6] for row in self.rows], dtype=np.float64)
        return BlackBox(numbers[:, 0], numbers[:, 1:3], numbers[:, 4], phases, estimates)


def _is_alike(before: Row, row: Row) -> bool:
    """Return whether two rows differ only in their times."""
    if before[1:6] != row[1:6]:
        return False
    one, other = before[6], row[6]
    if one is None or other is None:
        return one is other
    return abs((one - before[0]) - (other - row[0])) < _SAME_ERROR
