"""Where on its path a robot is, and how it steers along the path.

Decides: the robot's arc length and the curvature to drive.  Must not know: time, speed plans,
phases.  Firmware: it imports only `math` and the curve, and allocates nothing after construction.

The curvature is the path's own just ahead plus the linear law of Samson (1992) for a unicycle,
-(lambda^2 e + 2 lambda theta): lateral error e and heading error theta die out, critically damped,
over the length 1 / lambda.
"""

from math import atan2, cos, inf, sin, sqrt

from protocol.curve import Curve

SETTLING_LENGTH = 0.1
"""1 / lambda [m]; it grows with the distance travelled per tick, so that the law stays stable."""

LED_OFF = 0.37 * SETTLING_LENGTH
"""How far [m/rad] off the path a heading error leads before it is corrected: 1 / (e lambda)."""

_TICKS_TO_SETTLE = 5.0
_LOOK_AHEAD_TICKS = 1.5
_LEAST_LOOK_AHEAD = 0.002
_SHARPEST = 250.0
"""No bend is steered sharper [rad/m]; where a path turns back at a place to pass, it may be so."""

_LONGEST_STEP = 0.05
_CLOSE_ENOUGH = 2e-4
_STILL = 1e-9
"""A robot whose pose stays the same is not located again once s changes by less than this [m]: the
last bits of s would never come to rest."""

_BESIDE = 2e-3
"""A place found on the path is right if the robot is at most this far [m] before or behind it."""

_SEARCH_WAY = 0.3
_SEARCH_STEP = 0.02
_SEARCH_END = 1e-5


class PathFollower:
    """A robot on a curve: after `locate`, it is `s` [m] along the curve and `lateral` [m] left.

    `beyond` [m] is how far past the curve's end it is, or (negative) before its beginning; `off`
    [m] is its distance from the curve's point at s, in any direction.  `heading_error` [rad] is the
    robot's heading minus the path's.  A pose that is not finite leaves s as it was and makes
    `lateral` and `off` infinite.
    """

    def __init__(self, curve: Curve) -> None:
        self.s = 0.0
        self.lateral = self.beyond = self.off = 0.0
        self.heading_error = 0.0
        self._curve = curve
        self._x = self._y = self._heading = inf
        self._tangent_s = inf  # Where the tangent was evaluated.
        self._tx = 1.0
        self._ty = 0.0
        self._still_at = inf  # s, if the last `locate` hardly changed it and still holds.
        self._bend_travel, self._bend = -inf, 0.0

    def start_pose(self) -> tuple[float, float, float]:
        """Return x, y [m] and heading [rad] at the curve's beginning."""
        self._tangent_at(0.0)
        return self._curve.x, self._curve.y, atan2(self._ty, self._tx)

    def joint(self, s: float, other: "PathFollower", there: float) -> tuple[float, float]:
        """Return how far this curve at s is from another one at `there` [m], and turned [rad]."""
        self._tangent_at(s)
        x, y, tx, ty = self._curve.x, self._curve.y, self._tx, self._ty
        other._tangent_at(there)
        dx, dy = other._curve.x - x, other._curve.y - y
        turn = atan2(tx * other._ty - ty * other._tx, tx * other._tx + ty * other._ty)
        return sqrt(dx * dx + dy * dy), turn

    def turn_at_start(self, x: float, y: float, heading: float) -> tuple[float, float]:
        """Return a pose's distance [m] from the curve's beginning and the turn needed [rad]."""
        self._tangent_at(0.0)
        dx, dy = x - self._curve.x, y - self._curve.y
        return sqrt(dx * dx + dy * dy), -self._turned_from_tangent(heading)

    def locate(self, x: float, y: float, heading: float) -> None:
        """Project a pose on the path near the last s, by Newton steps of one evaluation each."""
        s = self.s
        if s == self._still_at and x == self._x and y == self._y and heading == self._heading:
            return
        if not abs(x) + abs(y) + abs(heading) < 1e9:
            self.lateral = self.off = inf
            self._still_at = inf
            return
        self._x, self._y, self._heading = x, y, heading
        curve = self._curve
        length, began = curve.length, s
        for _ in range(4):
            self._tangent_at(s)
            along = (x - curve.x) * self._tx + (y - curve.y) * self._ty
            if along > _LONGEST_STEP:
                along = _LONGEST_STEP
            elif along < -_LONGEST_STEP:
                along = -_LONGEST_STEP
            before = s
            s += along
            if s < 0.0:
                s = 0.0
            elif s > length:
                s = length
            if abs(s - before) < _CLOSE_ENOUGH:
                break
        self._take(s)
        if abs(s - began) < _STILL:
            self._still_at, self._bend_travel = s, -inf

    def pose(self) -> tuple[float, float, float]:
        """Return the pose [m, m, rad] that was located last."""
        return self._x, self._y, self._heading

    def find(self) -> None:
        """Search the path around s for the point nearest to the pose of the last `locate`.

        After a robot has left a turn that was too sharp for it, Newton's steps do not get there.
        """
        if not self.lateral < inf or not self._x < inf:
            return
        s, step, nearest = self.s, _SEARCH_STEP, self._apart(self.s)
        self._take(s)
        if nearest * nearest <= self.lateral * self.lateral + _BESIDE * _BESIDE:
            return
        place, end = max(s - _SEARCH_WAY, 0.0), min(s + _SEARCH_WAY, self._curve.length)
        while place <= end:
            apart = self._apart(place)
            if apart < nearest:
                nearest, s = apart, place
            place += step
        while step > _SEARCH_END:
            step *= 0.5
            before, after = max(s - step, 0.0), min(s + step, self._curve.length)
            here = self._apart(s)
            if self._apart(before) < here:
                s = before
            elif self._apart(after) < here:
                s = after
        self._tangent_at(s)
        self._take(s)

    def away_from(self, s: float) -> float:
        """Return the distance [m] of the robot from the path's point at another s."""
        apart = self._apart(s)
        self._tangent_at(self.s)
        return apart

    def offset(self) -> tuple[int, int, int]:
        """Return the robot's offset: left of the path [mm], turned [mrad] and beyond it [mm]."""
        if not abs(self.lateral) + abs(self.beyond) < 32.0:
            return 0, 0, 0
        turn = round(1000.0 * self.heading_error)
        return round(1000.0 * self.lateral), turn, round(1000.0 * self.beyond)

    def curvature(self, travel: float) -> float:
        """Return the curvature [rad/m] to drive.

        `travel` [m] is the distance until the next tick.  To be called after `locate`: the
        look-ahead begins at the tangent found there.  For a robot that stands, the result for the
        last travel is kept.
        """
        still_at = self._still_at
        if still_at < inf and travel == self._bend_travel:
            return self._bend
        ahead = _LOOK_AHEAD_TICKS * travel
        if ahead < _LEAST_LOOK_AHEAD:
            ahead = _LEAST_LOOK_AHEAD
        left = self._curve.length - self.s
        if ahead > left:
            ahead = left
        bend = 0.0
        if ahead > _CLOSE_ENOUGH:
            tx, ty = self._tx, self._ty
            self._tangent_at(self.s + ahead)
            ahead_x, ahead_y = self._tx, self._ty
            bend = atan2(tx * ahead_y - ty * ahead_x, tx * ahead_x + ty * ahead_y) / ahead
            if still_at < inf:
                self._tx, self._ty, self._still_at = tx, ty, still_at
                self._tangent_s = inf
        if self.lateral < inf:
            rate = 1.0 / max(SETTLING_LENGTH, _TICKS_TO_SETTLE * travel)
            bend -= rate * (rate * self.lateral + 2.0 * self.heading_error)
        self._bend_travel, self._bend = travel, min(max(bend, -_SHARPEST), _SHARPEST)
        return self._bend

    def _take(self, s: float) -> None:
        """Set the robot's place to s, which must be where the tangent was last evaluated."""
        curve, tx, ty = self._curve, self._tx, self._ty
        self.s = s
        dx, dy = self._x - curve.x, self._y - curve.y
        self.lateral = dy * tx - dx * ty
        self.off = sqrt(dx * dx + dy * dy)
        self.beyond = dx * tx + dy * ty if s <= 0.0 or s >= curve.length else 0.0
        self.heading_error = self._turned_from_tangent(self._heading)

    def _apart(self, s: float) -> float:
        """Return the distance [m] of the robot from the path's point at s."""
        self._tangent_at(s)
        dx, dy = self._x - self._curve.x, self._y - self._curve.y
        return sqrt(dx * dx + dy * dy)

    def _turned_from_tangent(self, heading: float) -> float:
        x, y = cos(heading), sin(heading)
        return atan2(y * self._tx - x * self._ty, x * self._tx + y * self._ty)

    def _tangent_at(self, s: float) -> None:
        """Evaluate the curve at s and store its direction, unless it has none there."""
        self._still_at = inf
        if s == self._tangent_s:
            return
        self._tangent_s, curve = s, self._curve
        curve.place(s)
        dx, dy = curve.dx, curve.dy
        size = sqrt(dx * dx + dy * dy)
        if size > 1e-9:
            self._tx, self._ty = dx / size, dy / size
