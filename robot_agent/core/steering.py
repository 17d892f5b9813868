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
_LEAST_LOOK_AHEAD = 5e-4
_SHARPEST = 1000.0
"""No bend is steered sharper [rad/m]; where a path turns back at a place to pass, it may be so."""

_TIGHT = 25.0
"""In bends sharper than this [rad/m] the heading tells better than the position where on the path a
robot is: both legs of a hairpin are as near to it."""

_MOST_TURN = 0.3
"""Until the next tick a robot drives no farther than to where its path has turned by this much
[rad]."""

_TIGHT_WAY = 0.04
"""A robot is near a tight bend if it has seen one less than this far ahead [m]."""

_FAR = 2.0
"""No robot looks as far ahead [m] as this: a longer way that is clear limits it no more."""

_PLACE_NOISE = 4e-3
"""There it is sought as far from its last place as a late tick lets it drive, and this [m] more."""

_LONGEST_STEP = 0.05
_CLOSE_ENOUGH = 2e-4
_STILL = 1e-9
"""A robot whose pose stays the same is not located again once s changes by less than this [m]: the
last bits of s would never come to rest."""

_BESIDE = 2e-3
"""A place found on the path is right if the robot is at most this far [m] before or behind it."""

_SEARCH_WAY = 0.3
_SEARCH_STEP = 0.02
_SEARCH_END = 1e-4


class PathFollower:
    """A robot on a curve: after `locate`, it is `s` [m] along the curve and `lateral` [m] left.

    `beyond` [m] is how far ahead of the curve's point at s it is, which is little unless that is an
    end or a corner; `off` [m] is its distance from that point, in any direction.  `heading_error`
    [rad] is the robot's heading minus the path's.  A pose that is not finite leaves s as it was and
    makes `lateral` and `off` infinite.  After `curvature`, `reach` [m] is how far it may drive
    until the next tick.  `clear` [m] is how far ahead it may look; it doubles each tick after a
    tight bend.
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
        self.reach = inf
        self.clear = inf
        self._hx, self._hy = 1.0, 0.0  # The robot's direction.
        self._nearest, self._led = inf, 0.0

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
        return sqrt(dx * dx + dy * dy), -self._turn_from_tangent(cos(heading), sin(heading))

    def locate(self, x: float, y: float, heading: float) -> None:
        """Project a pose on the path near the last s, by Newton steps of one evaluation each.

        Near tight bends the nearest pose is searched instead.
        """
        s = self.s
        if s == self._still_at and x == self._x and y == self._y and heading == self._heading:
            return
        if not abs(x) + abs(y) + abs(heading) < 1e9:
            self.lateral = self.off = inf
            self._still_at = inf
            return
        self._x, self._y, self._heading = x, y, heading
        self._hx, self._hy = cos(heading), sin(heading)
        curve = self._curve
        length, began = curve.length, s
        if self.clear < _TIGHT_WAY:
            self._look_near(s, LED_OFF)
            self._search(3.0 * self.clear + _PLACE_NOISE)
            s = self.s
        else:
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
            else:
                self._tangent_at(s)
            self._take(s)
        if abs(s - began) < _STILL:
            self._still_at, self._bend_travel = s, -inf

    def pose(self) -> tuple[float, float, float]:
        """Return the pose [m, m, rad] that was located last."""
        return self._x, self._y, self._heading

    def find(self) -> None:
        """Search the path around s for the point nearest to the pose of the last `locate`.

        After a robot has left its path, Newton's steps may not get there.
        """
        if not self.lateral < inf or not self._x < inf:
            return
        s, apart = self.s, self._apart(self.s)
        self._take(s)
        if apart * apart <= self.lateral * self.lateral + _BESIDE * _BESIDE:
            return
        self._look_near(s, 0.0)
        place, end = max(s - _SEARCH_WAY, 0.0), s + _SEARCH_WAY
        while place <= end:
            self._go_nearer(place)
            place += _SEARCH_STEP
        self._search(_SEARCH_STEP)

    def _look_near(self, s: float, arm: float) -> None:
        """Begin a search at s; a heading error e counts 2 `arm` sin(e / 2) [m] there."""
        self._led = 2.0 * arm * arm
        self._nearest = self._pose_apart(s)

    def _search(self, step: float) -> None:
        """Go to the nearest place up to `step` [m] away along the path."""
        while step > _SEARCH_END:
            step *= 0.5
            if not self._go_nearer(self.s - step):
                self._go_nearer(self.s + step)
        self._tangent_at(self.s)
        self._take(self.s)

    def _go_nearer(self, s: float) -> bool:
        """Take s for the robot's place if that is nearer; return whether."""
        s = min(max(s, 0.0), self._curve.length)
        apart = self._pose_apart(s)
        if not apart < self._nearest:
            return False
        self._nearest, self.s = apart, s
        return True

    def _pose_apart(self, s: float) -> float:
        """Return how far the robot is from the path's pose at s, squared, less a constant [m^2]."""
        apart = self._apart(s)
        return apart * apart - self._led * (self._tx * self._hx + self._ty * self._hy)

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
        """Return the curvature [rad/m] to drive, and set `reach`.

        `travel` [m] is the distance until the next tick.  To be called after `locate`: the
        look-ahead begins at the tangent found there.  For a robot that stands, and is not near a
        tight bend, where it would change with `clear`, the result for the last travel is kept.
        """
        still_at = self._still_at
        if still_at < inf and travel == self._bend_travel and self.clear > _FAR:
            return self._bend
        ahead, left = travel, self._curve.length - self.s
        if ahead < _LEAST_LOOK_AHEAD:
            ahead = _LEAST_LOOK_AHEAD
        self.reach = inf
        if ahead > self.clear:
            ahead = self.reach = self.clear
        if ahead > left:
            ahead = left
        bend = 0.0
        if ahead > _CLOSE_ENOUGH:
            tx, ty = self._tx, self._ty
            turn = self._turn_ahead(tx, ty, ahead)
            while abs(turn) > _MOST_TURN and ahead > _LEAST_LOOK_AHEAD:
                ahead = self.reach = 0.5 * ahead
                turn = self._turn_ahead(tx, ty, ahead)
            bend = turn / ahead
            if abs(bend) > _TIGHT:
                self.clear = 2.0 * ahead
            else:
                self.clear *= 2.0
            if still_at < inf:
                self._tx, self._ty, self._still_at = tx, ty, still_at
                self._tangent_s = inf
        if self.lateral < inf:
            rate = 1.0 / max(SETTLING_LENGTH, _TICKS_TO_SETTLE * travel)
            bend -= rate * (rate * self.lateral + 2.0 * self.heading_error)
        self._bend_travel, self._bend = travel, min(max(bend, -_SHARPEST), _SHARPEST)
        return self._bend

    def _turn_ahead(self, tx: float, ty: float, ahead: float) -> float:
        """Return by how much the path has turned [rad] from a direction at s + `ahead` [m]."""
        self._tangent_at(self.s + ahead)
        return atan2(tx * self._ty - ty * self._tx, tx * self._tx + ty * self._ty)

    def _take(self, s: float) -> None:
        """Set the robot's place to s, which must be where the tangent was last evaluated."""
        curve, tx, ty = self._curve, self._tx, self._ty
        self.s = s
        dx, dy = self._x - curve.x, self._y - curve.y
        self.lateral = dy * tx - dx * ty
        self.off = sqrt(dx * dx + dy * dy)
        self.beyond = dx * tx + dy * ty
        self.heading_error = self._turn_from_tangent(self._hx, self._hy)

    def _apart(self, s: float) -> float:
        """Return the distance [m] of the robot from the path's point at s."""
        self._tangent_at(s)
        dx, dy = self._x - self._curve.x, self._y - self._curve.y
        return sqrt(dx * dx + dy * dy)

    def _turn_from_tangent(self, x: float, y: float) -> float:
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
