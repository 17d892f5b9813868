"""One robot of a world in virtual time: its service, its body, its own clock, what it truly did.

Decides: what reaches a robot that is dead or hangs, and what is written down of it.  Must not know:
other robots, and when a fault is due (world.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from protocol.phases import PHASE_NAMES
from protocol.timing import SECOND
from robot_agent.driver import DriverError
from robot_agent.service import RobotService
from sim.blackbox import BlackBox
from sim.failing_body import FailingBody
from sim.robot_clock import RobotClock

Row = tuple[float, float, float, float, float, str]


@dataclass(eq=False)
class Inhabitant:
    """A robot; `clock` is its own, as its program reads it.

    rows: t [s since the first GO], x, y [m], heading [rad], s [m], phase; of a robot that stands
    the first and the last such row are kept, which loses nothing.
    """

    service: RobotService
    body: FailingBody
    own_clock: RobotClock
    clock: Callable[[], int]
    dead: bool = False
    hung: bool = False
    rows: list[Row] = field(default_factory=list)

    def tick(self) -> None:
        """Let one control period pass; without a program the motors stop by their watchdog."""
        own_ns = self.clock()
        if self.dead or self.hung:
            self.body.step(own_ns)
            return
        try:
            self.service.tick(own_ns)
        except DriverError as error:
            self.body.stop()
            self.service.rescue(error, own_ns)

    def note(self, since_go_ns: int) -> None:
        """Write down where the body truly is."""
        pose, agent = self.body.true_pose(), self.service.agent
        if pose is None:
            return
        s = agent.ride.follower.s if agent.ride is not None else 0.0
        row = (since_go_ns / SECOND, *pose, s, PHASE_NAMES[agent.phase])
        rows = self.rows
        if len(rows) > 1 and rows[-1][1:] == row[1:] == rows[-2][1:]:
            rows.pop()
        rows.append(row)

    def blackbox(self) -> BlackBox:
        """Return what the robot truly did."""
        numbers = np.array([row[:5] for row in self.rows]).reshape(-1, 5)
        phases = tuple(row[5] for row in self.rows)
        return BlackBox(numbers[:, 0], numbers[:, 1:3], numbers[:, 4], phases)
