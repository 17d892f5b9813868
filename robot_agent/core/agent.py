"""The state machine of one robot: how it reacts to messages and time, without any I/O.

Decides: phases and faults, the speed to drive, when to report and what.  Must not know: bytes,
links, files, or any clock but the `now_ns` it is given (the robot's own, monotonic).  Firmware: it
imports only other firmware and the shared numbers; `tick` leaves no memory allocated.

The rules:
- A robot moves only in the epoch of the plan it holds, after GO, and only along that plan: never
  ahead of it, never beyond the plan time that it was granted (its authority).  It brakes in time
  for that place, and continues when it is granted more.  A late robot catches up as its speed
  allows.
- A robot that does not know the time well enough drives at its plan's pace, as far as its authority
  goes.  It no longer knows the time when an exchange contradicts those before it, when a Command's
  time stamp lies in the future, and after a late tick; it then synchronises its clock anew.
- With STOP a robot brakes at once; it keeps its plan and continues with the next GO.
- A robot that is off its path, or whose driver fails, brakes along its path and freezes; so does
  one that is told to.  It moves again only with the plan of a later epoch.
- When another coordinator takes over, the robot learns its clock; before motion it also drops the
  old one's plan (leader.py).  Once it has moved, it obeys the coordinators of its own run alone.
- A robot that drives, or is at its goal, holds at most one newer course of its epoch, and changes
  to it where that begins, or where the two still run together.  It does not take one whose
  beginning it has passed otherwise, or one that its course does not lead into.
- A robot accepts a plan when it is idle or armed and the plan's coordinator and epoch are those of
  the newest Command (or no Command has been heard yet).  It arms when it also stands at the plan's
  start and knows the time well enough; until then it reports why it does not.
- A robot at its goal, whether it braked or not, stays there for that epoch; if it is pushed off the
  goal, it brakes and freezes.
- A robot never reports a position, with one exception: one that has stopped on its way reports the
  arc length at which it rests, in its first report as frozen and whenever the coordinator asks.
"""

from math import inf

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
    MOVING,
    NO_FAULT,
    OFF_PATH,
    OVER,
    STOP,
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
from robot_agent.core.ride import HOLD_OUT, NOTHING, Ride

LATE_TICK = 50 * MILLISECOND
"""When a tick is this late [ns], the motors' watchdog has already stopped the robot."""

CLOCK_PATIENCE = 3.0
"""A robot at its start that cannot learn the time for this long [s] arms without it."""

_ON_ITS_WAY = (MOVING, BRAKING)
_WITH_COURSE = (MOVING, BRAKING, DONE)
_TAKE_COURSES = (MOVING, DONE, FROZEN)
_NEVER = -(1 << 62)


class Agent:
    """The state of one robot; `max_speed` is in m/s, 0 when it is not known.

    To be read after `tick`: drive_speed [m/s], drive_curvature [rad/m], drive_distance [m];
    drive_turn [rad] is not 0 where the robot has to turn on the spot instead.
    To be read after `report_due`: report_sequence, epoch, phase, fault and report_s [m] or None;
    when report_s is a number, the other numbers of `rest` are to be reported with it.  The report
    states report_stamp_ms, unless it is NOTHING, and report_late, in steps of LATE_STEP_MS, and
    `revision`, the course that it drives, and `holds`, the newest course that it holds.  A Command
    says how far the courses with `number` and `next_number` may be driven.
    `ride` is the course that the robot drives, with its position on the path, or None.
    """

    def __init__(self, max_speed: float = 0.0, period_ns: int = SECOND // 100) -> None:
        self.clock, self.phase, self.fault = ClockSync(), IDLE, NO_FAULT
        self.epoch = self.number = self.revision = 0
        self.next_number = self.holds = 0
        self._taken = 0  # The newest course that it has held: one that it dropped is gone for good.
        self.finished = False
        self.ride: Ride | None = None
        self._coming: Ride | None = None
        self.drive_speed = self.drive_curvature = self.drive_distance = self.drive_turn = 0.0
        self.report_sequence = 0
        self.report_s: float | None = None
        self.report_stamp_ms, self.report_late = NOTHING, 0
        self.rest = RestingPlace()
        self._max_speed, self._period = max_speed, period_ns / SECOND
        self._unsure = 0.0  # How long [s] it stands at its start without knowing the time.
        self._late_tick_ns = max(LATE_TICK, 2 * period_ns)
        self._ticked_ns = -_NEVER
        self._passed = 0.0  # How long [s] the wheels may have turned since the last tick.
        self._leader = Leader()
        self._spent_epoch = self._start_ns = 0
        self._reported = (0, 0, 0, 0, 0)
        self._reported_ns = self._hello_ns = _NEVER

    def hear_command(
        self,
        boot: int,
        term: int,
        sequence: int,
        epoch: int,
        phase: int,
        start_ns: int,
        said_ns: int,
        authority_ms: int,
        wanted: bool,
        now_ns: int,
        run: int = 0,
        next_authority_ms: int = NOTHING,
    ) -> bool:
        """Process a Command and return whether it was accepted.

        `authority_ms`: the plan time that this robot may not pass, NOTHING if it is not named;
        `next_authority_ms`: the same on its newer course.
        `wanted`: whether the Command asks this robot where it rests.  `run`: which run of the fleet
        the Command is of.
        """
        leader, before_motion = self._leader, self.phase in (IDLE, ARMED)
        if not before_motion and run != leader.run:
            return False
        if not leader.counts(term, boot, sequence, before_motion, now_ns):
            return False
        leader.run = run
        if epoch != leader.epoch and self.ride is None:
            self.fault = NO_FAULT
        if leader.hear(term, boot, sequence, epoch, phase, now_ns):
            self.clock.start_over(now_ns)
            if before_motion:
                self._apply(transitions.NEW_EPOCH, now_ns)
        elif self.clock.is_said_in_future(said_ns, now_ns):
            self._lose_clock(now_ns)
        if phase in (FREEZE, OVER):
            self._apply(transitions.TOLD_TO_FREEZE, now_ns)
            self.finished = phase == OVER and self.phase != BRAKING
        elif epoch > self.epoch and self.ride is not None:
            self._apply(transitions.NEW_EPOCH, now_ns)
        elif epoch == self.epoch and self.ride is not None:
            self.ride.halt(phase == STOP)
            if phase == GO:
                self._grant(self.ride, authority_ms, next_authority_ms)
                self._start_ns = start_ns
                self._go(self.ride, said_ns, now_ns)
        if wanted:
            self.rest.ask()
        return True

    def _grant(self, ride: Ride, authority_ms: int, next_authority_ms: int) -> None:
        ride.grant(authority_ms)
        if self._coming is not None:
            self._coming.grant(next_authority_ms)

    def _go(self, ride: Ride, said_ns: int, now_ns: int) -> None:
        """Set out; without a known time not before the plan has surely begun."""
        if said_ns >= self._start_ns or self._knows_time(ride, now_ns):
            self._apply(transitions.GO, now_ns)

    def hear_plan(
        self,
        boot: int,
        epoch: int,
        number: int,
        revision: int,
        rules: tuple[int, int, int],
        path: tuple[int, list[float], list[float], list[float], list[float]],
        motion: tuple[list[float], list[float], list[float], list[float], float],
    ) -> None:
        """Process a plan (see Ride for its parts); `boot` is the boot id of its coordinator.

        A plan that is not valid is reported as BAD_PLAN and discarded; a newer course that is not
        valid, or that the robot cannot change to, is discarded.
        """
        leader = self._leader
        if leader.boot < 0:
            leader.boot, leader.epoch = boot, epoch
        if boot != leader.boot or epoch != leader.epoch:
            return
        if epoch == self.epoch and self.ride is not None and self.phase in _TAKE_COURSES:
            if revision > self._taken:
                self._hear_course(self.ride, number, revision, rules, path, motion)
            return
        if self.phase not in (IDLE, ARMED) or epoch <= max(self.epoch, self._spent_epoch):
            return
        self.phase, self.ride, self.epoch, self.fault = IDLE, None, 0, NO_FAULT
        self._unsure = 0.0
        try:
            self.ride = Ride(epoch, rules, path, motion, self._max_speed, self._period)
            self.epoch, self.number, self.next_number = epoch, number, number
            self.revision = self.holds = self._taken = revision
        except (ValueError, ArithmeticError, IndexError):
            self.fault = BAD_PLAN

    def _hear_course(
        self,
        ride: Ride,
        number: int,
        revision: int,
        rules: tuple[int, int, int],
        path: tuple[int, list[float], list[float], list[float], list[float]],
        motion: tuple[list[float], list[float], list[float], list[float], float],
    ) -> None:
        """Hold a newer course, if the robot stands at its beginning, or is on its way there."""
        try:
            coming = Ride(self.epoch, rules, path, motion, self._max_speed, self._period)
        except (ValueError, ArithmeticError, IndexError):
            return
        fits = self._stands(ride) and ride.rests_where(coming)
        if fits or (self.phase != FROZEN and ride.leads_into(coming, self.phase == DONE)):
            ride.end_with(coming)
            self._coming, self.next_number = coming, number
            self.holds = self._taken = revision

    def _stands(self, ride: Ride) -> bool:
        """Return whether the robot has stopped, or was never let set out on its course.

        In that case the coordinator may have taken that back before the robot heard of it, and send
        another one from where the robot stands.
        """
        return self.phase == FROZEN or not ride.is_granted()

    def hear_clock(
        self, coordinator: int, sent_ns: int, received_ns: int, answered_ns: int, now_ns: int
    ) -> None:
        """Process an answer to a question about the time; `coordinator`: the boot id of its sender.

        Only the coordinator that the robot obeys tells it the time.
        """
        if coordinator != self._leader.boot:
            return
        if not self.clock.add(sent_ns, received_ns, answered_ns, now_ns):
            self._lose_clock(now_ns)

    def hear_driver_error(self, now_ns: int) -> None:
        """Process a failure of the base or of the program around this core."""
        self._fail(DRIVER_ERROR, now_ns)

    def tick(self, now_ns: int, x: float, y: float, heading: float) -> None:
        """Decide what the robot at this pose [m, m, rad] does until the next tick."""
        ride, phase = self.ride, self.phase
        passed_ns = now_ns - self._ticked_ns
        self._ticked_ns = now_ns
        if passed_ns > self._late_tick_ns:
            self.clock.doubt(now_ns)  # The robot hung, or its clock was set.
        passed = passed_ns / SECOND if passed_ns > 0 else 0.0
        self._passed = passed if passed < HOLD_OUT else HOLD_OUT
        self.clock.follow(now_ns, phase in _ON_ITS_WAY)
        self.drive_speed = self.drive_curvature = self.drive_distance = self.drive_turn = 0.0
        if ride is None:
            return
        if phase == ARMED and not self._knows_time(ride, now_ns):
            self._disarm(now_ns)
        if self._coming is not None:
            if phase in _WITH_COURSE or (phase == FROZEN and self._leader.phase == GO):
                ride = self._on_course(ride, self._coming, now_ns, x, y, heading)
            phase = self.phase
        if self.phase == IDLE:
            self._try_to_arm(ride, now_ns, x, y, heading)
        elif phase in _ON_ITS_WAY:
            self._drive(ride, now_ns, x, y, heading)
        elif phase == DONE:
            self.stays(now_ns, x, y, heading)

    def quiet_until(self, now_ns: int) -> int:
        """Return until when [ns] a robot that rests has nothing to send.

        That is so for a robot that is at its goal or frozen, after a tick in which it has sent what
        was due, as long as it hears nothing.  A shell may then call `skip` and `stays` instead of
        `tick`.  The result is `now_ns` if there is more to do.
        """
        ride = self.ride
        if self.phase not in (DONE, FROZEN) or ride is None or self._coming is not None:
            return now_ns
        if self._reported != (self.epoch, self.phase, self.fault, self.revision, self.holds):
            return now_ns
        enough = ride.clock_error_ns - CLOCK_RESERVE
        return min(self._reported_ns + REPORT_PERIOD, self.clock.quiet_until(enough))

    def skip(self, now_ns: int) -> bool:
        """Let a tick of a robot that rests pass; False if the tick is late."""
        if now_ns - self._ticked_ns > self._late_tick_ns:
            return False
        self.skip_all(now_ns)
        return True

    def skip_all(self, now_ns: int) -> None:
        """Let all ticks of a robot that rests pass that came by now, none of them late."""
        self._ticked_ns = now_ns
        self.clock.follow(now_ns, False)

    def is_safe_at_rest(self, x: float, y: float, heading: float, error: float) -> bool:
        """Return whether `stays` can only return True for a robot that rests at this pose.

        `error` [m]: how far beside it the robot may seem to be.
        """
        ride = self.ride
        if self.phase != DONE or ride is None:
            return self.phase == FROZEN
        ride.follower.locate(x, y, heading)
        return ride.from_goal() + 2.0 * error <= ride.track

    def stays(self, now_ns: int, x: float, y: float, heading: float) -> bool:
        """Return whether a robot that rests is where it was; at its goal it may be pushed off."""
        ride = self.ride
        if self.phase != DONE or ride is None:
            return True
        ride.follower.locate(x, y, heading)
        if ride.has_left_goal():
            self._fail(OFF_PATH, now_ns)
            return False
        return True

    def report_due(self, now_ns: int) -> bool:
        """Return whether to report now; if so, the report counts as sent."""
        state = (self.epoch, self.phase, self.fault, self.revision, self.holds)
        if now_ns - self._reported_ns < REPORT_PERIOD and state == self._reported:
            return False
        self._reported, self._reported_ns = state, now_ns
        self.report_sequence += 1
        self.report_s = self.rest.s if self.rest.is_due() else None
        self.report_stamp_ms, self.report_late = NOTHING, 0
        ride = self.ride
        if ride is not None and self.phase in (MOVING, DONE):
            ride.reckon(int(1000.0 * self._plan_time(ride, now_ns, 0.0)))
            self.report_stamp_ms = ride.stamp_ms
            if self.phase == MOVING:  # A robot at its goal is as far as it will get.
                self.report_late = ride.late
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
        return self.clock.due(now_ns, enough, self.phase in _ON_ITS_WAY)

    def has_driven(self) -> bool:
        """Return whether the robot has ever set out on a plan, or frozen while it held a plan."""
        return self._spent_epoch > 0

    def _try_to_arm(self, ride: Ride, now_ns: int, x: float, y: float, heading: float) -> None:
        """Arm at the start, as soon as the time is known well enough or for CLOCK_PATIENCE not."""
        ride.follower.locate(x, y, heading)  # If it fails before it sets out, it rests there.
        stands, self.fault, self.drive_turn = ride.stands_at_start(x, y, heading)
        if not stands:
            return
        self._unsure += self._passed
        if self.clock.is_within(ride.clock_error_ns - CLOCK_RESERVE, now_ns):
            self._unsure = 0.0
            self._apply(transitions.READY, now_ns)
        elif self._unsure > CLOCK_PATIENCE:
            self._apply(transitions.READY, now_ns)
        else:
            self.fault = CLOCK_UNSURE

    def _disarm(self, now_ns: int) -> None:
        """Arm again with the time, unless the robot does without it."""
        if self.phase == ARMED and self._unsure <= CLOCK_PATIENCE:
            self._apply(transitions.NOT_READY, now_ns)

    def _drive(self, ride: Ride, now_ns: int, x: float, y: float, heading: float) -> None:
        """Follow the plan by the clock, or brake, and take over what the ride commands.

        Without a known time the robot drives at its plan's pace.
        """
        ride.follower.locate(x, y, heading)
        if self.phase == MOVING:
            fault = NO_FAULT
            if ride.may_turn:
                fault, self.drive_turn = ride.turn_before_start(x, y, heading)
            now = self._plan_time(ride, now_ns, self._passed)
            fault = fault or ride.trouble()
            if fault != NO_FAULT:
                self._fail(fault, now_ns)
            elif ride.arrived():
                self._apply(transitions.ARRIVED, now_ns)
            else:
                ride.keep_to_plan(now)
        if self.phase == BRAKING:
            ride.keep_braking()
            if ride.rests(x, y):
                there = ride.at_goal()
                self._apply(transitions.ARRIVED if there else transitions.AT_REST, now_ns)
        self.drive_speed, self.drive_distance = ride.speed, ride.distance
        self.drive_curvature = ride.curvature

    def _on_course(
        self, ride: Ride, coming: Ride, now_ns: int, x: float, y: float, heading: float
    ) -> Ride:
        """Return the course to drive now: the newer one, once it has begun."""
        ride.follower.locate(x, y, heading)
        if self._stands(ride) and ride.rests_where(coming):
            is_over = self._has_begun(coming, now_ns)
        elif self.phase == DONE and not self._knows_time(ride, now_ns):
            is_over = ride.is_over(coming, inf, True)  # At its goal no plan time passes then.
        else:
            now = self._plan_time(ride, now_ns, 0.0)
            is_over = self.phase != FROZEN and ride.is_over(coming, now, self.phase == DONE)
        return self._change(ride, coming, now_ns) if is_over else ride

    def _has_begun(self, coming: Ride, now_ns: int) -> bool:
        """Return whether a course from where the robot rests has begun, as far as it can know."""
        if not self._knows_time(coming, now_ns):
            return True
        return self._plan_time(coming, now_ns, 0.0) >= coming.begin

    def _change(self, ride: Ride, coming: Ride, now_ns: int) -> Ride:
        """Leave a course for the next one, and return that."""
        coming.follow(ride)
        self.ride, self._coming = coming, None
        self.number, self.revision = self.next_number, self.holds
        self._apply(transitions.NEW_COURSE, now_ns)
        return coming

    def _lose_clock(self, now_ns: int) -> None:
        """Synchronise the clock anew."""
        self.clock.start_over(now_ns)
        self._disarm(now_ns)

    def _fail(self, fault: int, now_ns: int) -> None:
        """Brake, and record the fault if none is recorded yet.

        At the goal the only fault is OFF_PATH.  A robot that has heard no Command yet arms again:
        it does not know the run whose Commands it would obey once it had failed.
        """
        if self.fault == NO_FAULT and (self.phase != DONE or fault == OFF_PATH):
            self.fault = fault
        event = transitions.LEFT_PATH if fault == OFF_PATH else transitions.TROUBLE
        self._apply(event if self._leader.is_known() else transitions.NOT_READY, now_ns)

    def _apply(self, event: str, now_ns: int) -> None:
        """Enter the phase that TRANSITIONS names for this event, and do what the phase needs."""
        after = transitions.TRANSITIONS.get((self.phase, event))
        if after is None:
            return
        self.phase = after
        if event == transitions.NEW_EPOCH and after == IDLE:
            self._drop_plan(now_ns)
        elif after == BRAKING and self.ride is not None:
            self.ride.begin_to_brake()
        elif after in (FROZEN, DONE) and self.ride is not None:
            self._rest(self.ride, after == FROZEN)
            if after == FROZEN:  # Where a course that has not begun begins is not where it stands.
                self._coming, self.holds, self.next_number = None, self.revision, self.number
        elif after == MOVING:
            self.fault = NO_FAULT
            self.rest.leave()
        if after in (MOVING, FROZEN):
            self._spent_epoch = self.epoch

    def _rest(self, ride: Ride, tell: bool) -> None:
        """Stand, and store the place of rest until the robot moves, even if the plan is dropped."""
        ride.stand()
        self.rest.keep(self.epoch, self.revision, ride.follower.s, ride.follower.offset(), tell)

    def _drop_plan(self, now_ns: int) -> None:
        self.ride, self._coming, self.epoch, self.fault = None, None, 0, NO_FAULT
        self.rest.hush()
        self.clock.start_over(now_ns)

    def _knows_time(self, ride: Ride, now_ns: int) -> bool:
        return self.clock.is_within(ride.clock_error_ns, now_ns)

    def _plan_time(self, ride: Ride, now_ns: int, passed: float) -> float:
        """Return the plan time [s] that it is now.

        Without a known time it is so many seconds after the one that the robot drove by last.
        """
        if self._knows_time(ride, now_ns):
            return (now_ns + self.clock.offset_ns - self._start_ns) / SECOND
        return ride.time + passed
