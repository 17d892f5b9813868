"""The arc length s(t) of a robot at plan time t, from its speed knots and stops.

Decides: the meaning of `profile` and `stops` on the wire.  Firmware: it imports only `array` and
`math`, and allocates nothing after construction.  The robot and the proof both use it, so that what
is proven is what is driven.
"""

from array import array
from math import inf, sqrt


class Timeline:
    """The motion s(t) along a path; times [s] are plan times, s is arc length [m].

    `profile_s`, `profile_v`: speed knots, v^2 linear in s between neighbours (constant
    acceleration).  `stop_s`, `stop_depart`: the robot rests at stop_s until plan time stop_depart
    (not at all if it gets there after that time); a stop at s = 0 is a late start.  The motion
    begins at plan time `begin`.  Raises ValueError when the numbers do not describe a motion.
    """

    def __init__(
        self,
        profile_s: list[float],
        profile_v: list[float],
        stop_s: list[float],
        stop_depart: list[float],
        begin: float = 0.0,
    ) -> None:
        _check(profile_s, profile_v, stop_s, stop_depart)
        self.t0 = array("d", [])
        self.t1 = array("d", [])
        self.s0 = array("d", [])
        self.s1 = array("d", [])
        self.v0 = array("d", [])
        self.v1 = array("d", [])
        self.arrivals: list[float] = []
        self._leg = 0
        self._leg_from = self._leg_to = inf
        self._leg_numbers = [0.0] * 6
        time, stop = begin, 0
        for i in range(len(profile_s) - 1):
            s, v = profile_s[i], profile_v[i]
            end_s, end_v = profile_s[i + 1], profile_v[i + 1]
            slope = (end_v * end_v - v * v) / (end_s - s)
            while stop < len(stop_s) and stop_s[stop] < end_s:
                if stop_s[stop] > s:
                    next_v = sqrt(max(v * v + slope * (stop_s[stop] - s), 0.0))
                    time = self._add_leg(time, s, stop_s[stop], v, next_v)
                    s, v = stop_s[stop], next_v
                self.arrivals.append(time)
                time = max(time, stop_depart[stop])
                stop += 1
            time = self._add_leg(time, s, end_s, v, end_v)
        self.finish = time
        self.length = profile_s[-1]

    def s_at(self, time: float) -> float:
        """Return the arc length [m] at a plan time [s], from 0 to `length`."""
        if not self._leg_from <= time < self._leg_to:
            self._find(time)
        begin, end, s0, s1, v0, half_rate = self._leg_numbers
        passed = time - begin
        if passed <= 0.0:
            return s0
        if time >= end:
            return s1
        return s0 + passed * (v0 + half_rate * passed)

    def v_at(self, time: float) -> float:
        """Return the speed [m/s] at a plan time [s]; 0 while the robot rests."""
        leg = self._find(time)
        passed = time - self.t0[leg]
        if passed < 0.0 or time >= self.t1[leg]:
            return 0.0
        rate = (self.v1[leg] - self.v0[leg]) / (self.t1[leg] - self.t0[leg])
        return self.v0[leg] + rate * passed

    def time_at(self, s: float) -> float:
        """Return when the motion first comes to s [m]; beyond the end, the finish time."""
        for leg in range(len(self.t0)):
            if s <= self.s1[leg]:
                passed = max(s - self.s0[leg], 0.0)
                v0, v1 = self.v0[leg], self.v1[leg]
                slope = (v1 * v1 - v0 * v0) / (self.s1[leg] - self.s0[leg])
                v = sqrt(max(v0 * v0 + slope * passed, 0.0))
                return self.t0[leg] + (2.0 * passed / (v0 + v) if passed > 0.0 else 0.0)
        return self.finish

    def next_stop(self, time: float) -> tuple[float, float] | None:
        """Return (s, departure) of the present or next stop; None after the last one."""
        for leg in range(self._find(time), len(self.t0)):
            if time < self.t0[leg] and (leg == 0 or self.t1[leg - 1] < self.t0[leg]):
                return self.s0[leg], self.t0[leg]
        return None

    def rest_until(self, time: float) -> float:
        """Return when the rest at a plan time [s] ends; the time itself where the robot drives."""
        leg = self._find(time)
        if time < self.t0[leg]:
            return self.t0[leg]
        if time >= self.t1[leg] and leg < len(self.t0) - 1:
            return self.t0[leg + 1]
        return time

    def _find(self, time: float) -> int:
        """Return the last leg that has begun, or the first leg if none has.

        The search starts at the leg found last; the numbers of the leg found are kept.
        """
        leg, last = self._leg, len(self.t0) - 1
        if self._leg_from <= time < self._leg_to:
            return leg
        while leg < last and time >= self.t0[leg + 1]:
            leg += 1
        while leg > 0 and time < self.t0[leg]:
            leg -= 1
        self._leg = leg
        self._leg_from = self.t0[leg] if leg > 0 else -inf
        self._leg_to = self.t0[leg + 1] if leg < last else inf
        numbers, begin, end = self._leg_numbers, self.t0[leg], self.t1[leg]
        numbers[0], numbers[1] = begin, end
        numbers[2], numbers[3], numbers[4] = self.s0[leg], self.s1[leg], self.v0[leg]
        numbers[5] = 0.5 * ((self.v1[leg] - self.v0[leg]) / (end - begin)) if end > begin else 0.0
        return leg

    def _add_leg(self, time: float, s0: float, s1: float, v0: float, v1: float) -> float:
        end = time + 2.0 * (s1 - s0) / (v0 + v1)
        self.t0.append(time)
        self.t1.append(end)
        self.s0.append(s0)
        self.s1.append(s1)
        self.v0.append(v0)
        self.v1.append(v1)
        return end


def _check(
    profile_s: list[float],
    profile_v: list[float],
    stop_s: list[float],
    stop_depart: list[float],
) -> None:
    if len(profile_s) < 2 or len(profile_v) != len(profile_s) or profile_s[0] != 0.0:
        raise ValueError("a speed profile has at least two knots and begins at s = 0")
    for i in range(len(profile_s)):
        if not 0.0 <= profile_v[i] < 1e3:
            raise ValueError(f"speed {profile_v[i]} m/s at s = {profile_s[i]} m is not a speed")
        if i and not profile_s[i] > profile_s[i - 1]:
            raise ValueError(f"speed knots do not increase at s = {profile_s[i]} m")
        if i and not profile_v[i] + profile_v[i - 1] > 0.0:
            raise ValueError(f"the robot would stand for ever before s = {profile_s[i]} m")
    for i in range(len(stop_s)):
        if not 0.0 <= stop_s[i] < profile_s[-1] or (i and not stop_s[i] > stop_s[i - 1]):
            raise ValueError(f"stop at s = {stop_s[i]} m is out of order or off the path")
        if not -1e6 < stop_depart[i] < 1e6:
            raise ValueError(f"departure at {stop_depart[i]} s is not a plan time")
