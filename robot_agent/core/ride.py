"""A plan being driven: where on the path the robot is, whether it is late, how fast to drive.

Decides: speed and distance of every command to the driver, and whether the robot is late, has
arrived, or rests.  Must not know: phases, messages, clocks; `time` is plan time in seconds.
Firmware: it imports only `math`, other firmware and the shared numbers.
"""

from math import ceil, inf, sqrt

from protocol.curve import Curve
from protocol.phases import LATE, NO_FAULT, OFF_PATH
from protocol.timeline import Timeline
from protocol.timing import LATE_STEP_MS, SECOND
from robot_agent.core.steering import PathFollower

ARRIVAL_SLACK = 1e-3
"""A robot has arrived when it is within this distance [m] of its goal."""

LATE_SHARE = 0.2
"""A robot is on time while it seems behind by no more than this share of the track tolerance:
measured positions are noisy."""

ARRIVAL_SHARE = 0.8
"""When its plan has ended, a robot within this share of the track tolerance of its goal has
arrived. The rest of the tolerance is for noise, which must not make the robot seem pushed off its
goal."""

TURN_SHARE = 0.9
"""A robot that would start farther off its path than this share of its tolerance turns first."""

LATE_TIME = 0.05
LATE_TIME_SHARE = 0.2
"""A robot is late once it has seemed late for LATE_TIME [s], or for LATE_TIME_SHARE of its share of
lateness if that is less: one of hundreds of noisy measurements at a stop may be far off.  The delay
is a part of the share of lateness."""

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

NO_LIMIT = 1 << 62
"""The authority [ms] of a robot whose coordinator states none."""

REACTION_TICKS = 3
"""A robot that nears the end of its authority begins to brake this many ticks early."""

MOST_LATE = 65_535
"""The largest lateness that a report can state, in steps of LATE_STEP_MS."""

_SPARE_SPEED = 1.05


class Ride:
    """One plan and the robot on it.

    The track tolerance limits the sum of two distances: how far the robot is off its path, to the
    side or past an end, and how far it is from its planned place along the path.  For a robot
    behind its plan only the distance that exceeds its share of lateness counts.

    `rules`: late [ns], lease [ns], track [mm], brake [mm/s^2, 0 stops at once], clock error [ns].
    `path`: the arguments of Curve.  `motion`: the arguments of Timeline.  Raises ValueError when
    these are not a valid plan.  The command to the driver is left in the attributes speed [m/s],
    curvature [rad/m] and distance [m].
    """

    def __init__(
        self,
        epoch: int,
        rules: tuple[int, int, int, int, int],
        path: tuple[int, list[float], list[float], list[float], list[float]],
        motion: tuple[list[float], list[float], list[float], list[float]],
        max_speed: float,
        period: float,
    ) -> None:
        late_ns, self.lease_ns, track_mm, brake_mmps2, self.clock_error_ns = rules
        self.epoch = epoch
        self.late = late_ns / SECOND
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
        self._stuck_from = self._behind_from = inf
        self._stood_s = inf
        self._late_time = min(LATE_TIME, LATE_TIME_SHARE * self.late)
        self._stuck_s = -inf
        self._pace = inf
        self._pace_time, self._pace_s = -inf, 0.0
        self._authority = inf
        self._reaction = REACTION_TICKS * period
        self._foresight = HOLD_OUT + self._reaction + self._limit / self._brake

    def grant(self, authority_ms: int) -> None:
        """Take in the plan time that the robot may not pass; what it was granted before, it keeps.

        NO_LIMIT: the robot may drive as its plan says.
        """
        authority = inf if authority_ms == NO_LIMIT else authority_ms / 1000.0
        if authority == inf or self._authority == inf:
            self._authority = authority
        else:
            self._authority = max(self._authority, authority)

    def late_steps(self, stamp_ms: int) -> int:
        """Return how far the robot is behind its plan, in steps of LATE_STEP_MS, rounded up.

        It counts as being where it seems to be, or as far ahead of that as it may be off.
        """
        reached = self.follower.s + self._bearable()
        if reached >= self._timeline.s_at(stamp_ms / 1000.0):
            return 0
        late_ms = stamp_ms - 1000.0 * self._timeline.time_at(max(reached, 0.0))
        return min(max(ceil(late_ms / LATE_STEP_MS), 0), MOST_LATE)

    def take_times(
        self,
        motion: tuple[list[float], list[float], list[float], list[float]],
        time: float,
    ) -> bool:
        """Replace the times on the same path; return False, without a change, if they do not fit.

        They do not fit if their length differs, or if the robot would be ahead of its plan with
        them.
        """
        try:
            timeline = Timeline(*motion)
        except (ValueError, ArithmeticError, IndexError):
            return False
        longer = abs(timeline.length - self._timeline.length)
        if longer > ARRIVAL_SLACK or self.follower.s > timeline.s_at(time) + self._bearable():
            return False
        self._timeline = timeline
        self._behind_from = inf
        return True

    def planned_at(self, s: float) -> float:
        """Return the plan time [s] at which the plan has the robot at arc length s [m]."""
        return self._timeline.time_at(s)

    def missed(self, time: float) -> bool:
        """Return whether the robot is farther behind its plan than its share of lateness allows."""
        return not self.follower.s >= self._timeline.s_at(time - self.late) - self._bearable()

    def seems_late(self) -> bool:
        """Return whether the robot seemed late at the last tick, confirmed or not."""
        return self._behind_from < inf

    def stands_at_start(self, x: float, y: float, heading: float) -> tuple[bool, int, float]:
        """Return whether the robot may start from a pose, else its fault, else its turn [rad].

        A turn that is not 0 is what the robot has to turn on the spot before it may start.
        """
        if self.follower.misplacement(x, y, heading) <= TURN_SHARE * self.track:
            return True, NO_FAULT, 0.0
        off, turn = self.follower.turn_at_start(x, y, heading)
        if off <= TURN_SHARE * self.track:
            return False, NO_FAULT, turn
        return False, OFF_PATH, 0.0

    def is_off(self) -> bool:
        """Return whether the robot is off its path, beside it or beyond its ends."""
        return not self.follower.off <= self.track

    def trouble(self, time: float) -> int:
        """Return the fault that ends the ride now, or NO_FAULT."""
        ahead = self.follower.s - self._timeline.s_at(time)
        if not self.follower.off + max(ahead, 0.0) <= self.track:
            return OFF_PATH
        return LATE if self._is_late(time) else NO_FAULT

    def arrived(self, time: float) -> bool:
        """Return whether the plan has ended and the robot is at its goal.

        At first the robot has to be within ARRIVAL_SLACK, because one whose wheels slip may still
        come closer.  Shortly before it would count as late, ARRIVAL_SHARE of the track tolerance
        is enough.
        """
        left, over = self._timeline.length - self.follower.s, time - self._timeline.finish
        if over >= self.late - self._late_time:
            return left + self.follower.off <= ARRIVAL_SHARE * self.track
        return over >= 0.0 and left <= ARRIVAL_SLACK and self.follower.off <= self._slack

    def at_goal(self) -> bool:
        """Return whether the robot is where the plan ends."""
        left = self._timeline.length - self.follower.s
        return left <= ARRIVAL_SLACK and not self.is_off()

    def has_left(self, goal: bool) -> bool:
        """Return whether the robot was pushed off its goal, or off the place where it stood.

        For a robot that still brakes, only its distance from the path counts.
        """
        rest, moved = self._timeline.length if goal else self._stood_s, 0.0
        if rest < inf:
            moved = abs(rest - self.follower.s)
        return not self.follower.off + moved <= self.track

    def keep_to_plan(self, time: float) -> None:
        """Command the plan's mean speed until the next tick, plus a share of the lag to catch up.

        The commanded distance ends where the plan will be after HOLD_OUT, so that the robot does
        not overshoot a stop when the next tick is late.
        """
        timeline, s = self._timeline, self.follower.s
        planned = timeline.s_at(time)
        if not abs(s - self._stuck_s) <= REST_SLACK:
            self._stuck_from, self._stuck_s = time, s
        passed = time - self._pace_time
        if passed >= PACE_TIME:
            self._pace = (s - self._pace_s) / passed if passed < 1.0 else inf
            self._pace_time, self._pace_s = time, s
        speed = (timeline.s_at(time + self._period) - planned) / self._period
        lag = planned - s
        more = lag * self._catch_up
        if lag > 0.0:
            more = min(more, sqrt(2.0 * CATCH_UP_BRAKE * self._brake * lag))
        self.speed = min(max(speed + more, 0.0), self._limit)
        room = timeline.s_at(time + HOLD_OUT) - s
        if self._authority < time + self._foresight:
            room = self._within_authority(room)
        self._reach(room)

    def _within_authority(self, room: float) -> float:
        """Return the room [m] that is left, at most to where the authority ends; limit the speed.

        The speed is such that the robot can brake before that place after REACTION_TICKS.
        """
        left = max(self._timeline.s_at(self._authority) - self.follower.s, 0.0)
        if self._brake == inf:
            self.speed = min(self.speed, left / self._reaction)
        else:
            lost = self._brake * self._reaction
            self.speed = min(self.speed, sqrt(lost * lost + 2.0 * self._brake * left) - lost)
        return min(room, left)

    def begin_to_brake(self, time: float) -> None:
        """Start to brake, from the commanded speed or the measured one, whichever is less.

        A robot that has not moved is commanded to stand.  The measured speed is a mean over
        PACE_TIME; the speed that the robot may have gained since is added to it.
        """
        stuck = time - self._stuck_from >= REST_TIME
        seen = max(self._pace, 0.0) + 2.0 * PACE_TIME * self._brake
        self._brake_speed = 0.0 if stuck else min(self.speed, seen)
        self._brake_from = time
        self._rest_from = self._stood_s = inf

    def keep_braking(self, time: float) -> None:
        """Command a speed that falls evenly; a braking robot does not pass a stop of the plan."""
        passed = max(time - self._brake_from, 1e-9)
        self.speed = max(self._brake_speed - self._brake * passed, 0.0)
        room = self._timeline.s_at(time + HOLD_OUT) - self.follower.s
        self._reach(min(room, self.speed * HOLD_OUT))

    def rests(self, time: float, x: float, y: float) -> bool:
        """Return whether the robot is at rest; to be called every tick while it brakes."""
        moved = not abs(x - self._rest_x) + abs(y - self._rest_y) <= REST_SLACK
        if self.speed > 0.0 or moved or self._rest_from == inf:
            self._rest_from, self._rest_x, self._rest_y = time, x, y
        return time - self._rest_from >= REST_TIME

    def stand(self) -> None:
        """Command the robot to stand, and find where on the path it is."""
        self.follower.find()
        self._stood_s = self.follower.s
        self.hold()

    def hold(self) -> None:
        """Command the robot to stand until the next tick."""
        self.speed = self.curvature = self.distance = 0.0

    def _is_late(self, time: float) -> bool:
        """Return whether lateness is confirmed; to be called every tick while the robot moves."""
        if not self.missed(time + self._late_time):
            self._behind_from = inf
            return False
        self._behind_from = min(self._behind_from, time)
        return time - self._behind_from >= self._late_time

    def _bearable(self) -> float:
        """Return how far [m] behind its plan the robot may seem to be without counting as late.

        This is at most what its distance off the path leaves of the track tolerance.
        """
        return min(self._slack, self.track - self.follower.off)

    def _reach(self, distance: float) -> None:
        self.distance = max(distance, 0.0)
        self.curvature = self.follower.curvature(self.speed * self._period)
