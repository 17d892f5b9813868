"""The state machine of one robot: how it reacts to messages and time, without any I/O.

Decides: phases and faults, the speed to drive, when to report and what.  Must not know: bytes,
links, files, or any clock but the `now_ns` it is given (the robot's own, monotonic).  Firmware: it
imports only other firmware and the shared numbers; `tick` leaves no memory allocated.

The rules:
- A robot moves only in the epoch of the plan it holds, after GO, and only along that plan: never
  ahead of it, and never farther behind it than its share of lateness.
- Whatever goes wrong while it moves makes it brake along its path and freeze.  A robot that has
  braked moves again only with the plan of a later epoch.
- When another coordinator takes over, the robot drops the old one's plan and clock (leader.py).
- The robot no longer knows the time when an exchange contradicts those before it, or when a
  Command's time stamp lies in the future.  After a late tick it does not know the time until the
  next exchange.  A moving robot then stands or brakes and an armed one disarms; both synchronise
  their clock anew.
- A robot accepts a plan when it is idle or armed and the plan's coordinator and epoch are those of
  the newest Command (or no Command has been heard yet).  It arms when it also stands at the plan's
  start and knows the time well enough; until then it reports why it does not.
- A robot brakes in time so as not to pass the plan time that it was granted (its authority), and
  continues when it is granted more.
- A GO is not obeyed when the plan is already too far ahead: the robot stays where it is.
- A robot at its goal, whether it braked or not, stays there for that epoch; if it is pushed off the
  goal, it is frozen.
- A robot never reports a position, with one exception: one that has stopped on its way reports the
  arc length at which it rests, in its first report as frozen and whenever the coordinator asks.
- A robot that stands because it is late reports instead, as long as the others move, the plan time
  at which its plan has it there.  With new times for the rest of its path it continues in the same
  epoch.
"""

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
    IDLE,
    LATE,
    LEASE_OUT,
    MOVING,
    NO_FAULT,
    OFF_PATH,
    OVER,
)
from protocol.timing import (
    CLOCK_ERROR,
    CLOCK_RESERVE,
    HELLO_PERIOD,
    MILLISECOND,
    REPORT_PERIOD,
    SECOND,
)
from robot_agent.core import transitions
from robot_agent.core.clock_sync import ClockSync
from robot_agent.core.leader import Leader
from robot_agent.core.resting_place import RestingPlace
from robot_agent.core.ride import NO_LIMIT, Ride

LATE_TICK = 50 * MILLISECOND
"""When a tick is this late [ns], the motors' watchdog has already stopped the robot."""

_NEVER = -(1 << 62)


class Agent:
    """The state of one robot; `max_speed` is in m/s, 0 when it is not known.

    To be read after `tick`: drive_speed [m/s], drive_curvature [rad/m], drive_distance [m];
    drive_turn [rad] is not 0 where the robot has to turn on the spot instead.
    To be read after `report_due`: report_sequence, epoch, phase, fault and report_s [m] or None;
    when report_s is a number, the other numbers of `rest` are to be reported with it.  The report
    states report_stamp_ms, unless it is NO_LIMIT, and report_late, in steps of LATE_STEP_MS.
    `revision` counts the new times received in this epoch.
    `ride` is the plan that the robot holds, with its position on the path, or None.
    """

    def __init__(self, max_speed: float = 0.0, period_ns: int = SECOND // 100) -> None:
        self.clock, self.phase, self.fault = ClockSync(), IDLE, NO_FAULT
        self.epoch = self.revision = 0
        self.finished = False
        self.ride: Ride | None = None
        self.drive_speed = self.drive_curvature = self.drive_distance = self.drive_turn = 0.0
        self.report_sequence = 0
        self.report_s: float | None = None
        self.report_stamp_ms, self.report_late = NO_LIMIT, 0
        self.rest = RestingPlace()
        self._max_speed, self._period = max_speed, period_ns / SECOND
        self._late_tick_ns = max(LATE_TICK, 2 * period_ns)
        self._ticked_ns, self._sure_ns = -_NEVER, 0
        self._leader = Leader()
        self._spent_epoch = self._start_ns = 0
        self._reported = (0, 0, 0, 0)
        self._reported_ns = self._hello_ns = _NEVER

    def hear_command(
        self,
        boot: int,
        sequence: int,
        epoch: int,
        phase: int,
        start_ns: int,
        wanted: bool,
        now_ns: int,
        said_ns: int = 0,
        authority_ms: int = NO_LIMIT,
    ) -> bool:
        """Process a Command and return whether it was accepted.

        `wanted`: whether it asks this robot where it rests.  `authority_ms`: the plan time that
        this robot may not pass.
        """
        leader, before_motion = self._leader, self.phase in (IDLE, ARMED)
        if not leader.counts(boot, sequence, epoch, before_motion, now_ns):
            return False
        own_clock = boot == leader.boot and not leader.has_other_clock
        if own_clock and self.clock.is_said_in_future(said_ns, now_ns):
            self._lose_clock(now_ns)
        if self._is_alone(now_ns) and (self.phase == MOVING or self.fault == LATE):
            self._fail(LEASE_OUT, now_ns)  # This Command may have waited while the robot hung.
        if epoch != leader.epoch and self.ride is None:
            self.fault = NO_FAULT
        said_ns = said_ns - self.clock.offset_ns if said_ns and self.clock.good else now_ns
        if leader.hear(boot, sequence, epoch, phase, now_ns, said_ns) and before_motion:
            self._apply(transitions.NEW_EPOCH, now_ns)
        if phase in (FREEZE, OVER):
            self._apply(transitions.TOLD_TO_FREEZE, now_ns)
            self.finished = phase == OVER and self.phase != BRAKING
        elif epoch > self.epoch and self.ride is not None:
            self._apply(transitions.NEW_EPOCH, now_ns)
        elif (phase, epoch) == (GO, self.epoch) and self.ride is not None:
            self.ride.grant(authority_ms)
            if self.phase == ARMED and not self._is_alone(now_ns):
                self._hear_go(start_ns, now_ns)
        if wanted:
            self.rest.ask()
        return True

    def hear_plan(
        self,
        boot: int,
        epoch: int,
        rules: tuple[int, int, int, int, int],
        path: tuple[int, list[float], list[float], list[float], list[float]],
        motion: tuple[list[float], list[float], list[float], list[float]],
    ) -> None:
        """Process a plan (see Ride for its parts); `boot` is the boot id of its coordinator.

        A plan that is not valid is reported as BAD_PLAN and discarded.
        """
        leader = self._leader
        if leader.boot < 0:
            leader.boot, leader.epoch = boot, epoch
        if boot != leader.boot or epoch != leader.epoch:
            return
        if self.phase not in (IDLE, ARMED) or epoch <= max(self.epoch, self._spent_epoch):
            return
        self.phase, self.ride, self.epoch, self.fault = IDLE, None, 0, NO_FAULT
        try:
            self.ride = Ride(epoch, rules, path, motion, self._max_speed, self._period)
            self.epoch = epoch
        except (ValueError, ArithmeticError, IndexError):
            self.fault = BAD_PLAN

    def hear_times(
        self,
        boot: int,
        epoch: int,
        revision: int,
        motion: tuple[list[float], list[float], list[float], list[float]],
        now_ns: int,
    ) -> None:
        """Process new times for the plan being driven; times that do not fit it are ignored."""
        if self.ride is None or boot != self._leader.boot or epoch != self.epoch:
            return
        goes_on = self.phase == MOVING or self.awaits_times()
        goes_on = goes_on and revision > self.revision and not self._is_alone(now_ns)
        goes_on = goes_on and self._knows_time(self.ride, now_ns)
        if goes_on and self.ride.take_times(motion, self._plan_time(now_ns)):
            self.revision = revision
            self._apply(transitions.NEW_TIMES, now_ns)

    def hear_clock(self, sent_ns: int, received_ns: int, answered_ns: int, now_ns: int) -> None:
        """Process the coordinator's answer to a question about the time."""
        stamps = (sent_ns, received_ns, answered_ns, now_ns)
        if not self._leader.has_other_clock and not self.clock.add(*stamps):
            self._lose_clock(now_ns)

    def hear_driver_error(self, now_ns: int) -> None:
        """Process a failure of the base or of the program around this core."""
        self._fail(DRIVER_ERROR, now_ns)

    def tick(self, now_ns: int, x: float, y: float, heading: float) -> None:
        """Decide what the robot at this pose [m, m, rad] does until the next tick."""
        ride = self.ride
        if now_ns - self._ticked_ns > self._late_tick_ns:
            self.clock.doubt(now_ns)  # The robot hung, or its clock was set.
            self._sure_ns = now_ns
        self._ticked_ns = now_ns
        self.clock.follow(now_ns, self.phase in (MOVING, BRAKING))
        self.drive_speed = self.drive_curvature = self.drive_distance = self.drive_turn = 0.0
        if ride is None:
            return
        if self.phase == ARMED and not self._knows_time(ride, now_ns):
            self._apply(transitions.NOT_READY, now_ns)
        if self.phase == IDLE:
            self._try_to_arm(ride, now_ns, x, y, heading)
        elif self.phase in (MOVING, BRAKING, DONE) or self.fault == LATE:
            ride.follower.locate(x, y, heading)
            time = self._plan_time(now_ns)
            if self.phase == MOVING:
                self._keep_to_plan(ride, time, now_ns)
            elif ride.has_left(self.phase == DONE) and (self.phase == DONE or self.fault == LATE):
                self._fail(OFF_PATH, now_ns)
            elif self.fault == LATE and self._is_alone(now_ns):
                self._fail(LEASE_OUT, now_ns)
            if self.phase == BRAKING:
                ride.keep_braking(time)
                if ride.rests(time, x, y):
                    there = ride.at_goal()
                    self._apply(transitions.ARRIVED if there else transitions.AT_REST, now_ns)
            self.drive_speed, self.drive_distance = ride.speed, ride.distance
            self.drive_curvature = ride.curvature

    def report_due(self, now_ns: int) -> bool:
        """Return whether to report now; if so, the report counts as sent.

        A moving robot does not report while it may be late.
        """
        state = (self.epoch, self.revision, self.phase, self.fault)
        recent = state == self._reported and now_ns - self._reported_ns < REPORT_PERIOD
        if recent or (self.phase == MOVING and self._may_be_late(now_ns)):
            return False
        self._reported, self._reported_ns = state, now_ns
        self.report_sequence += 1
        self.report_s = self.rest.s if self.rest.is_due() else None
        self.report_stamp_ms, self.report_late = NO_LIMIT, 0
        ride = self.ride
        if ride is not None and self.phase in (MOVING, DONE) and self._knows_time(ride, now_ns):
            stamp_ms = (now_ns + self.clock.offset_ns - self._start_ns) // MILLISECOND
            self.report_stamp_ms = stamp_ms
            if self.phase == MOVING:  # A robot at its goal is as far as it will get.
                self.report_late = ride.late_steps(stamp_ms)
        return True

    def hello_due(self, now_ns: int) -> bool:
        """Return whether to send a Hello now; if so, it counts as sent."""
        if self.ride is not None or now_ns - self._hello_ns < HELLO_PERIOD:
            return False
        self._hello_ns = now_ns
        return True

    def clock_due(self, now_ns: int) -> bool:
        """Return whether to ask for the time now; if so, the question counts as sent."""
        enough = (self.ride.clock_error_ns if self.ride else CLOCK_ERROR) - CLOCK_RESERVE
        return self.clock.due(now_ns, enough, self.phase in (MOVING, BRAKING))

    def awaits_times(self) -> bool:
        """Return whether the robot stands because it is late while the others move."""
        late = self.phase == FROZEN and self.fault == LATE
        return late and self._leader.phase == GO and self._leader.epoch == self.epoch

    def has_driven(self) -> bool:
        """Return whether the robot has ever set out on a plan, or frozen while it held a plan."""
        return self._spent_epoch > 0

    def may_leave(self, now_ns: int) -> bool:
        """Return whether nothing is left to do.

        That is when the fleet has ended, or when the robot is at its goal and its lease has run
        out.
        """
        return self.finished or (self.phase == DONE and self._is_alone(now_ns))

    def _hear_go(self, start_ns: int, now_ns: int) -> None:
        self._start_ns = start_ns
        if self.ride is not None and self.ride.missed(self._plan_time(now_ns)):
            self.fault = LATE
            self._apply(transitions.GO_TOO_LATE, now_ns)
        else:
            self._apply(transitions.GO_IN_TIME, now_ns)

    def _try_to_arm(self, ride: Ride, now_ns: int, x: float, y: float, heading: float) -> None:
        stands, self.fault, self.drive_turn = ride.stands_at_start(x, y, heading)
        if not stands:
            return
        if self.clock.error_ns(now_ns) > ride.clock_error_ns - CLOCK_RESERVE:
            self.fault = CLOCK_UNSURE
        else:
            self._apply(transitions.READY, now_ns)

    def _keep_to_plan(self, ride: Ride, time: float, now_ns: int) -> None:
        """Follow the plan; without a known time stand, and brake after `ride.late` seconds."""
        knows_time = self._knows_time(ride, now_ns)
        if knows_time:
            self._sure_ns = now_ns
            fault = ride.trouble(time)
        else:
            unsure = (now_ns - self._sure_ns) / SECOND > ride.late
            fault = OFF_PATH if ride.is_off() else CLOCK_UNSURE if unsure else NO_FAULT
        if knows_time and ride.arrived(time) and fault != OFF_PATH:
            self._apply(transitions.ARRIVED, now_ns)
            return
        if fault == NO_FAULT and self._is_alone(now_ns):
            fault = LEASE_OUT
        if fault != NO_FAULT:
            self._fail(fault, now_ns)
        elif knows_time:
            ride.keep_to_plan(time)
        else:
            ride.hold()

    def _may_be_late(self, now_ns: int) -> bool:
        ride = self.ride
        return ride is not None and (ride.seems_late() or not self._knows_time(ride, now_ns))

    def _knows_time(self, ride: Ride, now_ns: int) -> bool:
        return self.clock.error_ns(now_ns) <= ride.clock_error_ns

    def _lose_clock(self, now_ns: int) -> None:
        """Synchronise the clock anew; a robot that is driving by its timetable brakes."""
        self.clock.start_over(now_ns)
        if self.phase == MOVING or self.awaits_times():
            self._fail(CLOCK_UNSURE, now_ns)
        elif self.phase == ARMED:
            self._apply(transitions.NOT_READY, now_ns)

    def _fail(self, fault: int, now_ns: int) -> None:
        """Brake, and record the fault if none but LATE is recorded yet.

        At the goal the only fault is OFF_PATH.
        """
        if self.fault in (NO_FAULT, LATE) and (self.phase != DONE or fault == OFF_PATH):
            self.fault = fault
        left = fault == OFF_PATH
        self._apply(transitions.LEFT_PATH if left else transitions.TROUBLE, now_ns)

    def _apply(self, event: str, now_ns: int) -> None:
        """Enter the phase that TRANSITIONS names for this event, and do what the phase needs."""
        after = transitions.TRANSITIONS.get((self.phase, event))
        if after is None:
            return
        self.phase = after
        if event == transitions.NEW_EPOCH and after == IDLE:
            self._drop_plan(now_ns)
        elif after == BRAKING and self.ride is not None:
            self.ride.begin_to_brake(self._plan_time(now_ns))
        elif after in (FROZEN, DONE) and self.ride is not None:
            self._rest(self.ride, after == FROZEN)
        elif after == MOVING:
            self.fault = NO_FAULT
            self._sure_ns = now_ns
            self.rest.leave()
        if after in (MOVING, FROZEN):
            self._spent_epoch = self.epoch

    def _rest(self, ride: Ride, tell: bool) -> None:
        """Stand, and store the place of rest until the robot moves, even if the plan is dropped."""
        ride.stand()
        s, tell = ride.follower.s, tell and not self.awaits_times()
        self.rest.keep(self.epoch, s, ride.follower.offset(), ride.planned_at(s), tell)

    def _drop_plan(self, now_ns: int) -> None:
        self.ride, self.epoch, self.revision, self.fault = None, 0, 0, NO_FAULT
        self.rest.hush()
        self._leader.has_other_clock = False
        self.clock.start_over(now_ns)

    def _plan_time(self, now_ns: int) -> float:
        return (now_ns + self.clock.offset_ns - self._start_ns) / SECOND

    def _is_alone(self, now_ns: int) -> bool:
        return self.ride is not None and self._leader.is_silent(self.ride.lease_ns, now_ns)
