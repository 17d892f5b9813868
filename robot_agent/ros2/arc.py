"""What a base is told by velocities alone, so that it keeps to a commanded distance and stops.

Decides: the velocities at a moment after a command.  Must not know: links, clocks, threads.
"""

from __future__ import annotations

from math import copysign

from robot_agent.driver import Driver
from robot_agent.loop import PERIOD_NS

_TURN_GAIN = 4.0
"""How quickly [1/s] the angle that is left to turn on the spot falls."""


class Arc:
    """The command of a driver that was given last, with its time.

    `turn_rate` [rad/s]: how fast the base may turn on the spot.
    """

    def __init__(self, turn_rate: float) -> None:
        self._turn_rate = turn_rate
        self._since_ns, self._ends_ns = 0, 0
        self._speed = self._curvature = self._distance = self._rate = 0.0

    def drive(self, now_ns: int, speed: float, curvature: float, distance: float) -> None:
        """Take in an arc [m/s, rad/m, m]."""
        self._begin(now_ns)
        self._speed, self._curvature, self._distance = speed, curvature, distance

    def turn(self, now_ns: int, angle: float) -> None:
        """Take in a turn on the spot [rad]."""
        self._begin(now_ns)
        self._rate = copysign(min(self._turn_rate, _TURN_GAIN * abs(angle)), angle)

    def velocities(self, now_ns: int) -> tuple[float, float]:
        """Return the speed [m/s] and the rate of turn [rad/s] until PERIOD_NS later.

        Both are 0 when the distance has been driven or the watchdog has expired.
        """
        if now_ns >= self._ends_ns:
            return 0.0, 0.0
        left = self._distance - self._speed * (now_ns - self._since_ns) / 1e9
        speed = max(min(self._speed, left / (PERIOD_NS / 1e9)), 0.0)
        return speed, speed * self._curvature + self._rate

    def _begin(self, now_ns: int) -> None:
        self._since_ns, self._ends_ns = now_ns, now_ns + Driver.WATCHDOG_NS
        self._speed = self._curvature = self._distance = self._rate = 0.0
