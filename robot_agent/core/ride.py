"""A plan being driven: where on the path the robot is, how late it is, how fast to drive.

Decides: speed and distance of every command to the driver, and whether the robot is late, has
arrived, or rests.  Must not know: phases, messages, clocks; `now` is plan time in seconds.
Firmware: it imports only `math`, other firmware and the shared numbers.
"""

from math import floor, inf, sqrt

from protocol.curve import Curve
from protocol.phases import NO_FAULT, OFF_PATH
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS
from robot_agent.core.steering import LED_OFF, PathFollower

ARRIVAL_SLACK = 1e-3
"""A robot has arrived when it is within this distance [m] of its goal."""

LATE_SHARE = 0.2
"""A robot is on time while it seems behind by no more than this share of the track tolerance:
measured positions are noisy."""

ARRIVAL_SHARE = 0.8
"""A robot that has stopped before the end of its course is there if no more than this share of the
track tolerance is left.  The rest of the tolerance is for noise, which must not make the robot seem
pushed off its goal."""

TURN_SHARE = 0.9
"""A robot that would start farther off its path than this share of its tolerance turns first."""

ASKEW = 0.15
FACING = 0.05
"""A robot turns before it starts if its heading is wrong by more than ASKEW [rad], too, until it is
right to FACING [rad]: what it would lead off its path is part of the tolerance for driving."""

GRACE = 0.25
"""A robot that is behind its plan by less than this [s] catches up without changing its pace."""

ARRIVAL_PATIENCE = 0.2
"""How long [s] after the plan's end a robot that is nearly at its goal still tries to get there."""

HOLD_OUT = 0.05
"""How long [s] a command to the driver suffices if the next tick does not come."""

REST_TIME = 0.1
REST_SLACK = 3e-3
"""A robot commanded to stand is at rest when it has moved no more than REST_SLACK [m] in REST_TIME
[s]."""

PACE_TIME = 0.1
"""The robot's actual speed is measured over at least this time [s]."""

CATCH_UP_RATE = 10.0
"""Gain [1/s] from the distance that a robot lags behind to the speed that it adds to catch up.  It
is low enough that a slow base or a noisy position does not make the robot oscillate."""

QUICK_CATCH_UP_RATE = 25.0
QUICK_CATCH_UP_SHARE = 0.5
"""For a robot that starts and stops at once: its gain [1/s], and the largest share of its lag that
it makes up in one period.  Its plan arrives at a stop with full speed, and the robot must not take
long to creep up to that stop."""

CATCH_UP_BRAKE = 0.15
"""A robot that catches up relies on braking this share harder than its plan does.  So it becomes
punctual without getting ahead of the plan, even where the plan brakes."""

NOTHING = -(1 << 62)
"""The authority [ms] that a Command states for a robot of which it says nothing; no stamp [ms]."""

REACTION_TICKS = 3
"""A robot that nears the end of its authority begins to brake this many ticks early."""

MOST_HURRY = 1.1
"""A late robot's plan time runs at most so much faster: plans brake with 0.8 of what robots can,
and at this pace they ask for 0.8 * 1.1 ** 2 of it."""

MOST_LATE = 65_535
"""The largest lateness that a report can state, in steps of LATE_STEP_MS."""

MOST_STAMP = (1 << 31) - 1
"""The largest stamp that a report can state [ms]."""

_SPARE_SPEED = 1.05

JOINT_GAP = 3e-3
JOINT_TURN = 0.02
JOINT_SPEED = 0.02
"""How far apart two courses may be where one leads into the other [m, rad, m/s]."""


class Ride:
    """One plan and the robot on it.

    The track tolerance limits the sum of two distances: how far the robot is off its path, to the
    side or past an end, and how far it is beyond its authority along the path.  A robot may be
    behind its plan by any time, and ahead of it within its authority.

    `rules`: track [mm], brake [mm/s^2, 0 stops at once], clock error [ns].
    `path`: the arguments of Curve.  `motion`: the arguments of Timeline.  Raises ValueError when
    these are not a valid plan.  The command to the driver is left in the attributes speed [m/s],
    curvature [rad/m] and distance [m]; `time` is the plan time [s] that the robot drives by, which
    only grows.  What the robot is to report is left in `stamp_ms` and `late`, in steps of
    LATE_STEP_MS.
    """

    def __init__(
        self,
        epoch: int,
        rules: tuple[int, int, int],
        path: tuple[int, list[float], list[float], list[float], list[float]],
        motion: tuple[list[float], list[float], list[float], list[float], float],
        max_speed: float,
        period: float,
    ) -> None:
        track_mm, brake_mmps2, self.clock_error_ns = rules
        self.epoch = epoch
        self.stamp_ms, self.late = NOTHING, 0
        self.begin = motion[4]
        self.track = track_mm / 1000.0
        self.speed = self.curvature = self.distance = 0.0
        self._brake = brake_mmps2 / 1000.0 or inf
        self._period = period
        self._catch_up = CATCH_UP_RATE
        if self._brake == inf:
            quick = min(QUICK_CATCH_UP_RATE, QUICK_CATCH_UP_SHARE / period)
            self._catch_up = max(CATCH_UP_RATE, quick)
        curve = Curve(*path)
        self.follower = PathFollower(curve)
        self._timeline = Timeline(*motion)
        if abs(self._timeline.length - curve.length) > ARRIVAL_SLACK:
            raise ValueError(
                f"the motion ends at {self._timeline.length} m, the path at {curve.length} m"
            )
        self._slack = max(ARRIVAL_SLACK, LATE_SHARE * self.track)
        self._limit = max_speed or _SPARE_SPEED * max(motion[1])
        self._brake_speed = 0.0
        self._brake_from = -inf
        self._rest_from = inf
        self._rest_x = self._rest_y = 0.0
        self._stuck_from = 0.0
        self._stuck_s = -inf
        self._pace = inf
        self._pace_time, self._pace_s = -inf, 0.0
        self._told = self._authority = 0.0  # The latter ends where another course begins at rest.
        self._granted = self._timeline.s_at(0.0)  # Where [m] the authority ends.
        self._halted = self._holds = False
        self._watch = 0.0  # The time [s] that the ticks have taken, whatever clocks do.
        self.time = self.begin
        self._until = self._rests = inf  # When the next course begins [s], and if it does at rest.
        self.may_turn = self._turns = False
        self._rate = min(max(self._limit / max(motion[1]), 1.0), MOST_HURRY)
        self._reaction = REACTION_TICKS * period
        self._foresight = HOLD_OUT + self._reaction + self._limit / self._brake

    def grant(self, authority_ms: int) -> None:
        """Take in the plan time [ms] that the robot may not pass; it keeps what it had before."""
        authority = authority_ms / 1000.0
        if authority > self._told:
            self._told = authority
            self._limit_authority()

    def _limit_authority(self) -> None:
        self._authority = min(self._told, self._rests)
        self._granted = self._timeline.s_at(self._authority)

    def halt(self, halted: bool) -> None:
        """Let the robot brake where it is, or let it go on."""
        self._halted = halted

    def leads_into(self, coming: "Ride", at_goal: bool = False) -> bool:
        """Return whether the robot can change to another course where that begins.

        It can unless it has driven, or reported, beyond that; at its goal, or where its authority
        ends, it has not, however late it is.  Where it does not rest, the courses have one heading
        and one speed there; a robot may also come to rest where its authority ends.  A course that
        begins in motion may run along this one for a while: it counts where the robot is then.
        """
        begin, rests = coming.begin, coming.begins_at_rest()
        reported = (self.stamp_ms - LATE_STEP_MS * self.late) / 1000.0
        time = begin if rests else max(begin, self.time, reported)
        s = self._timeline.length if at_goal else self._timeline.s_at(time)
        gap, turn = self.follower.joint(s, coming.follower, coming._timeline.s_at(time))
        if gap > JOINT_GAP:
            return False
        ends = at_goal or begin >= self._timeline.finish or self._told <= begin
        if rests and ends:
            return True
        if self.time > time or reported > time:
            return False
        if rests and self._timeline.v_at(begin) == 0.0:
            return True
        differ = abs(self._timeline.v_at(time) - coming._timeline.v_at(time))
        return differ <= JOINT_SPEED and abs(turn) <= JOINT_TURN

    def is_granted(self) -> bool:
        """Return whether the robot was let drive on this course."""
        return self._told > self.begin

    def rests_where(self, coming: "Ride") -> bool:
        """Return whether a robot that has stopped stands where another course begins, at rest."""
        mine = self.follower
        x, y, heading = mine.pose()  # Not finite for a robot that never armed.
        if not coming.begins_at_rest() or not mine.off < inf or not x < inf:
            return False
        return coming.follower.turn_at_start(x, y, heading)[0] <= TURN_SHARE * coming.track

    def begins_at_rest(self) -> bool:
        """Return whether the robot may rest where this course begins.

        One that starts and stops at once may, whatever speed the course has there.
        """
        return self._timeline.v_at(self.begin) == 0.0 or self._brake == inf

    def end_with(self, coming: "Ride") -> None:
        """Take in where another course begins; the robot stops there if that begins at rest."""
        self._until = coming.begin
        self._rests = coming.begin if coming.begins_at_rest() else inf
        self._limit_authority()

    def is_over(self, coming: "Ride", now: float, at_goal: bool) -> bool:
        """Return whether the next course has begun at a plan time [s], and the robot is there.

        One that is done (`at_goal`) is there as long as it was not pushed off its goal.

        To go on in motion it has to be granted as much on that course as on this one, or enough,
        and have turned towards this one.  It may be up to a tick short of that place, but within
        its track tolerance of it: others rely on it to have passed that place once it has changed.
        """
        if now < self._until:
            return False
        enough = min(self._told, self.time + self._foresight)
        if not coming.begins_at_rest() and (self.may_turn or coming._told < enough):
            return False
        if at_goal:
            return not self.has_left_goal()
        if self.time < min(self._until, self._timeline.finish):
            return False
        left = self._timeline.s_at(self._until) - self.follower.s
        if left <= ARRIVAL_SLACK:
            return True
        if left * left + self.follower.off * self.follower.off > self.track * self.track:
            return False
        is_stuck = self._watch - self._stuck_from >= REST_TIME
        return left <= (ARRIVAL_SHARE * self.track if is_stuck else self.speed * self._period)

    def follow(self, before: "Ride") -> None:
        """Go on from the course before this one, at this one's beginning or along it."""
        if not self.begins_at_rest():
            self.time = max(self.begin, before.time)
            passed = before.follower.s - before._timeline.s_at(self.begin)
            self.follower.s = min(max(passed, 0.0), self._timeline.length)
        self._halted, self._holds = before._halted, False
        self._limit_authority()
        self.may_turn = self.begins_at_rest()
        self._watch, self.speed, self._pace = before._watch, before.speed, before._pace
        self._pace_time = self._watch
        self._brake_speed, self._brake_from = before._brake_speed, before._brake_from

    def turn_before_start(self, x: float, y: float, heading: float) -> tuple[int, float]:
        """Return the fault, or the turn on the spot [rad], of a robot at rest before this course.

        `may_turn` tells that the robot has not stood ready at the course's beginning yet, nor left
        it.  Measured places are noisy, so it has left only beyond its track tolerance.  One that
        stands too far off the beginning to turn there, or seems to have left it before it had
        turned, does not set out as it looks.
        """
        if self.follower.s > self.track:
            self.may_turn = False
            if self._turns:
                return OFF_PATH, 0.0
        if self._halted or not self.may_turn:
            return NO_FAULT, 0.0
        stands, fault, turn = self.stands_at_start(x, y, heading)
        self.may_turn = not stands
        return fault, turn

    def reckon(self, now_ms: int) -> None:
        """Find what to report at a plan time [ms]: the robot has passed plan time stamp - late.

        It counts as being where it seems to be, or as far ahead of that as it may be off.
        """
        self.stamp_ms, self.late = now_ms, 0
        reached = self.follower.s + min(self._slack, self.track - self.follower.off)
        if reached < self._timeline.s_at(now_ms / 1000.0) or now_ms > MOST_STAMP:
            passed_ms = floor(1000.0 * self._timeline.time_at(max(reached, 0.0)))
            self.late = max(-((passed_ms - now_ms) // LATE_STEP_MS), 0)
            if self.late > MOST_LATE or now_ms > MOST_STAMP:
                self.stamp_ms, self.late = passed_ms, 0
        self.stamp_ms = max(self.stamp_ms, -MOST_STAMP)

    def _lags(self, time: float) -> bool:
        """Return whether the robot is more than GRACE behind a plan time.

        It may seem to be behind by what its distance off the path leaves of the track tolerance,
        but by no more than the slack.
        """
        follower = self.follower
        bearable = self.track - follower.off
        if bearable > self._slack:
            bearable = self._slack
        return not follower.s >= self._timeline.s_at(time - GRACE) - bearable

    def stands_at_start(self, x: float, y: float, heading: float) -> tuple[bool, int, float]:
        """Return whether the robot may start from a pose, else its fault, else its turn [rad].

        A turn that is not 0 is what the robot has to turn on the spot before it may start.
        """
        off, turn = self.follower.turn_at_start(x, y, heading)
        enough, angle = TURN_SHARE * self.track, abs(turn)
        if off + angle * LED_OFF <= enough and angle <= (FACING if self._turns else ASKEW):
            self._turns = False
            return True, NO_FAULT, 0.0
        self._turns = off <= enough
        return (False, NO_FAULT, turn) if self._turns else (False, OFF_PATH, 0.0)

    def is_off(self) -> bool:
        """Return whether the robot is off its path, beside it or beyond its ends."""
        return not self.follower.off <= self.track

    def trouble(self) -> int:
        """Return the fault that ends the ride now, or NO_FAULT."""
        follower = self.follower
        off = follower.off
        if off <= self.track < off + follower.s - self._granted:
            off = follower.away_from(self._granted)
        return NO_FAULT if off <= self.track else OFF_PATH

    def arrived(self) -> bool:
        """Return whether the plan has ended and the robot is at its goal.

        At first the robot has to be within ARRIVAL_SLACK, because one whose wheels slip may still
        come closer.  One that has stopped after ARRIVAL_PATIENCE comes no closer: beside its goal
        it has arrived, unless it is off its path.  Otherwise it would wait there for ever.
        """
        over = self.time - self._timeline.finish
        if over < 0.0:
            return False
        left = self._timeline.length - self.follower.s
        if over >= ARRIVAL_PATIENCE and self._watch - self._stuck_from >= REST_TIME:
            return left <= ARRIVAL_SHARE * self.track and not self.has_left_goal()
        return left <= ARRIVAL_SLACK and self.follower.off <= self._slack

    def at_goal(self) -> bool:
        """Return whether the robot is where the plan ends."""
        left = self._timeline.length - self.follower.s
        return left <= ARRIVAL_SLACK and not self.is_off()

    def has_left_goal(self) -> bool:
        """Return whether the robot was pushed off its goal."""
        return not self.from_goal() <= self.track

    def from_goal(self) -> float:
        """Return how far [m] the robot is from its goal: off its path and along it."""
        return self.follower.off + abs(self._timeline.length - self.follower.s)

    def keep_to_plan(self, now: float) -> None:
        """Command the plan's mean speed until the next tick, plus a share of the lag to catch up.

        The commanded distance ends where the plan will be after HOLD_OUT, so that the robot does
        not overshoot a stop when the next tick is late.  A robot that is late drives by an earlier
        plan time than now, so that it has the plan's speed at each place.  One that is ahead of
        its plan, because a clock was set or the plan's start was put off, brakes and waits.
        """
        timeline, s = self._timeline, self.follower.s
        period = self._period
        self._watch = watch = self._watch + period
        if self._halted or not abs(s - self._stuck_s) <= REST_SLACK:
            self._stuck_from, self._stuck_s = watch, s
        passed = watch - self._pace_time
        if passed >= PACE_TIME:
            self._pace = (s - self._pace_s) / passed if passed < 1.0 else inf
            self._pace_time, self._pace_s = watch, s
        if self._halted or now < self.time:
            if not self._holds:
                self.begin_to_brake()
                self._brake_from -= period
            self._holds = True
            if s > timeline.s_at(self.time):
                self.time = timeline.time_at(s)
            self._brake_on()
            return
        self._holds = False
        self.time = time = self._advanced(now) if self._lags(now) else now
        planned = timeline.s_at(time)
        speed = (timeline.s_at(time + period) - planned) / period
        lag = planned - s
        more = lag * self._catch_up
        if lag > 0.0:
            more = min(more, sqrt(2.0 * CATCH_UP_BRAKE * self._brake * lag))
        speed += more
        if speed < 0.0:
            speed = 0.0
        elif speed > self._limit:
            speed = self._limit
        self.speed = speed
        room = timeline.s_at(time + HOLD_OUT) - s
        if self._authority < time + self._foresight:
            room = self._within_authority(room)
        self.distance = room if room > 0.0 else 0.0
        self._steer()

    def _steer(self) -> None:
        """Set the curvature to drive; slow down where the path turns much until the next tick.

        A tick that is late lets the robot drive no more than twice that way.
        """
        follower, period = self.follower, self._period
        self.curvature = follower.curvature(self.speed * period)
        if self.speed * period > follower.reach:
            self.speed = follower.reach / period
        if self.distance > 2.0 * follower.reach:
            self.distance = 2.0 * follower.reach
        if self.may_turn:  # While it turns on the spot, its heading does not tell where it is.
            follower.clear = inf

    def _advanced(self, now: float) -> float:
        """Return the plan time [s] by which a robot drives that lags behind now.

        It runs as fast as the robot's greatest speed allows, ends waits at once, and stands still
        while the robot does not follow.
        """
        if self._lags(self.time):
            return self.time
        time = self._timeline.rest_until(self.time)
        return min(time + self._rate * self._period, now)

    def _within_authority(self, room: float) -> float:
        """Return the room [m] that is left, at most to where the authority ends; limit the speed.

        The speed is such that the robot can brake before that place after REACTION_TICKS.
        """
        left = self._granted - self.follower.s
        if left < 0.0:
            left = 0.0
        if self._brake == inf:
            most = left / self._reaction
        else:
            lost = self._brake * self._reaction
            most = sqrt(lost * lost + 2.0 * self._brake * left) - lost
        if self.speed > most:
            self.speed = most
        return room if room < left else left

    def begin_to_brake(self) -> None:
        """Start to brake, from the commanded speed or the measured one, whichever is less.

        A robot that has not moved is commanded to stand.  The measured speed is a mean over
        PACE_TIME; the speed that the robot may have gained since is added to it.
        """
        stuck = self._watch - self._stuck_from >= REST_TIME
        seen = max(self._pace, 0.0) + 2.0 * PACE_TIME * self._brake
        self._brake_speed = 0.0 if stuck else min(self.speed, seen)
        self._brake_from = self._watch
        self._rest_from = inf

    def keep_braking(self) -> None:
        """Command a speed that falls evenly; a braking robot does not pass a stop of the plan."""
        self._watch += self._period
        self._brake_on()

    def _brake_on(self) -> None:
        passed = self._watch - self._brake_from
        fell = self._brake * passed if passed > 0.0 else 0.0
        self.speed = max(self._brake_speed - fell, 0.0)
        later = self.time + passed + HOLD_OUT
        later = min(later, self._authority)
        room = self._timeline.s_at(later) - self.follower.s
        self.distance = max(min(room, self.speed * HOLD_OUT), 0.0)
        self._steer()

    def rests(self, x: float, y: float) -> bool:
        """Return whether the robot is at rest; to be called every tick while it brakes."""
        moved = not abs(x - self._rest_x) + abs(y - self._rest_y) <= REST_SLACK
        if self.speed > 0.0 or moved or self._rest_from == inf:
            self._rest_from, self._rest_x, self._rest_y = self._watch, x, y
        return self._watch - self._rest_from >= REST_TIME

    def stand(self) -> None:
        """Command the robot to stand, and find where on the path it is."""
        self.follower.find()
        self.hold()

    def hold(self) -> None:
        """Command the robot to stand until the next tick."""
        self.speed = self.curvature = self.distance = 0.0
