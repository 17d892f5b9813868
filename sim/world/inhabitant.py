"""One robot in virtual time: its service, its body, its own clock, and its true motion.

Decides: what a robot that is dead or hangs still does, and which rows are recorded.  Must not know:
other robots, and when a fault is due (virtual_fleet.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from protocol.timing import SECOND
from robot_agent.driver import DriverError
from robot_agent.service import RobotService
from sim.judging.blackbox import BlackBox, Row
from sim.world.failing_body import FailingBody
from sim.world.recording import Recording
from sim.world.robot_clock import RobotClock


@dataclass(eq=False)
class Inhabitant:
    """A robot; `clock` is its own clock as its program reads it.

    Its black box has a row for each row_period_ns and for each change of phase (recording.py).
    """

    service: RobotService
    body: FailingBody
    own_clock: RobotClock
    clock: Callable[[], int]
    dead: bool = False
    hung: bool = False
    row_period_ns: int = 1
    _recording: Recording = field(default_factory=Recording)
    _row_number: int = -1
    _own_ns: int = 0

    def run(self, service: RobotService) -> None:
        """Let the robot run another program."""
        self.service = service

    def tick(self) -> None:
        """Let one control period pass; without a running program the watchdog stops the motors."""
        own_ns = self._own_ns = self.clock()
        if self.dead or self.hung:
            self.body.step(own_ns)
            return
        service = self.service
        if self.body.is_at_rest() and service.rest(own_ns):
            return
        try:
            service.tick(own_ns)
        except DriverError as error:
            self.body.stop()
            self.service.rescue(error, own_ns)

    def note(self, now_ns: int, began_ns: int) -> None:
        """Record the body's true pose if a row is due, right after `tick`.

        `began_ns` is the virtual time of the first GO.
        """
        body, agent, recording = self.body, self.service.agent, self._recording
        number, phase = (now_ns - began_ns) // self.row_period_ns, agent.phase
        if body.x != body.x or (number == self._row_number and recording.last_phase == phase):
            return
        self._row_number = number
        ride, clock, estimate = agent.ride, agent.clock, None
        if clock.good and not (self.dead or self.hung):
            estimate = (self._own_ns + clock.offset_ns - began_ns) / SECOND
        s = ride.follower.s if ride is not None else 0.0
        t = (now_ns - began_ns) / SECOND
        recording.add((t, body.x, body.y, body.heading, s, phase, estimate))

    @property
    def rows(self) -> list[Row]:
        """The rows of its black box, with t in virtual time [s since the first GO]."""
        return self._recording.rows()

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
        return self._recording.blackbox()
