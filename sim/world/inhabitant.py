"""One robot in virtual time: its service, its body, its own clock, and its true motion.

Decides: what a robot that is dead or hangs still does, and which rows are recorded.  Must not know:
other robots, and when a fault is due (virtual_fleet.py).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from protocol.timing import SECOND
from robot_agent.driver import DriverError
from robot_agent.service import RobotService
from robot_agent.steady_clock import SteadyClock
from sim.judging.blackbox import BlackBox, Row
from sim.world.failing_body import FailingBody
from sim.world.recording import Recording
from sim.world.robot_clock import RobotClock

_NEVER: Final = 1 << 62

_DRIFT: Final = 50
"""A robot that sleeps wakes early by the share 1 / _DRIFT, so that its clock may run fast."""


@dataclass(eq=False)
class Inhabitant:
    """A robot; `clock` is its own clock as its program reads it, every `period_ns`.

    A robot that rests sleeps: the ticks in which its program would change nothing are made up for
    when it wakes (`wake`).  Its run is the same as without that, but that the arc length in its
    black box is the one of its true place meanwhile.

    Its black box has a row for each row_period_ns and for each change of phase (recording.py).
    """

    service: RobotService
    body: FailingBody
    own_clock: RobotClock
    clock: SteadyClock
    period_ns: int
    dead: bool = False
    hung: bool = False
    row_period_ns: int = 1
    _recording: Recording = field(default_factory=Recording)
    _row_number: int = -1
    _ticked_ns: int = 0
    _began_ns: int = 0
    _wakes_ns: int = 0  # Until when it sleeps; 0 if it is awake.

    def run(self, service: RobotService) -> None:
        """Let the robot run another program."""
        self.service = service

    def tick(self, now_ns: int, began_ns: int) -> None:
        """Let one control period pass, unless the robot sleeps, and record a row if one is due.

        `began_ns` is the virtual time of the first GO, 0 before it is known.
        """
        if self._wakes_ns:
            if now_ns < self._wakes_ns and not self.service.inbox.waits:
                return
            self.wake(now_ns - 1)
        self._ticked_ns = now_ns
        own_ns = self.clock()
        self._work(own_ns)
        if began_ns and now_ns >= began_ns:
            self._began_ns = began_ns
            self._note(now_ns, own_ns)
            self._sleep(now_ns, own_ns)

    def wake(self, now_ns: int) -> None:
        """Make up for the ticks slept through by now; call it before anything acts on the robot."""
        if not self._wakes_ns:
            return
        self._wakes_ns = 0
        before_ns, count = self._ticked_ns, (now_ns - self._ticked_ns) // self.period_ns
        if count <= 0:
            return
        self._ticked_ns += count * self.period_ns
        if self._works:
            self.body.skip_poses(count)
            self.service.agent.skip_all(self._read(self._ticked_ns))
        ticks = range(before_ns + self.period_ns, self._ticked_ns + 1, self.period_ns)
        due = [t for t in ticks if self._row_of(t) != self._row_of(t - self.period_ns)]
        for tick_ns in due[:1] + due[1:][-1:]:  # Of alike rows only these are kept.
            self._note(tick_ns, self._read(tick_ns))

    def _read(self, now_ns: int) -> int:
        """Return what the program would have read on its clock while it slept."""
        return self.clock.read_before(self.own_clock.at(now_ns))

    @property
    def _works(self) -> bool:
        """Whether the robot's program runs."""
        return not (self.dead or self.hung)

    def _work(self, own_ns: int) -> None:
        """Let the program do a tick; without a running one the watchdog stops the motors."""
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

    def _sleep(self, now_ns: int, own_ns: int) -> None:
        """Sleep as long as nothing can change unless something acts on the robot."""
        body, service = self.body, self.service
        if not body.is_at_rest():
            return
        if not self._works:
            self._wakes_ns = _NEVER
            return
        quiet_ns, place = service.quiet_until_ns - own_ns, body.true_pose()
        if quiet_ns <= self.period_ns or place is None:
            return
        if service.agent.is_safe_at_rest(*place, body.most_noise):
            self._wakes_ns = now_ns + quiet_ns - quiet_ns // _DRIFT

    def _row_of(self, now_ns: int) -> int:
        """Return the number of the row that a time is in."""
        return (now_ns - self._began_ns) // self.row_period_ns

    def _note(self, now_ns: int, own_ns: int) -> None:
        """Record the body's true pose if a row is due."""
        body, agent, recording = self.body, self.service.agent, self._recording
        number, phase = (now_ns - self._began_ns) // self.row_period_ns, agent.phase
        if body.x != body.x or (number == self._row_number and recording.last_phase == phase):
            return
        self._row_number = number
        ride, clock, estimate = agent.ride, agent.clock, None
        if clock.good and not (self.dead or self.hung):
            estimate = (own_ns + clock.offset_ns - self._began_ns) / SECOND
        s = ride.follower.s if ride is not None else 0.0
        t = (now_ns - self._began_ns) / SECOND
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
