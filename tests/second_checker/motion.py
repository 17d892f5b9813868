"""The arc length of a robot over plan time, from speed knots and stops.

Decides: what the timetable on the wire means.  Must not know: the product's reading of it.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np


@dataclass(frozen=True, eq=False)
class Motion:
    """Legs driven at constant acceleration: begin and end [s], arc length [m], speed [m/s]."""

    t0: np.ndarray
    t1: np.ndarray
    s0: np.ndarray
    s1: np.ndarray
    v0: np.ndarray
    v1: np.ndarray

    @property
    def finish(self):
        return float(self.t1[-1])

    def arc(self, times):
        """Return the arc length (m,) [m] at plan times (m,) [s]."""
        leg = np.maximum(np.searchsorted(self.t0, times, side="right") - 1, 0)
        lasts = self.t1[leg] - self.t0[leg]
        passed = np.clip(times - self.t0[leg], 0.0, lasts)
        rate = (self.v1[leg] - self.v0[leg]) / lasts
        s = self.s0[leg] + passed * (self.v0[leg] + 0.5 * rate * passed)
        return np.clip(np.where(passed >= lasts, self.s1[leg], s), self.s0[leg], self.s1[leg])


def motion_of(message):
    """Return the Motion of a message; ValueError when its numbers do not describe one."""
    stops, legs = [(float(s), float(t)) for s, t in message.stops], []
    time = float(message.begin)
    profile = [(float(s), float(v)) for s, v in message.profile]
    for (s, v), (end, end_v) in pairwise(profile):
        if not (end > s and v >= 0.0 and end_v >= 0.0 and v + end_v > 0.0):
            raise ValueError(f"no motion from {s} m at {v} m/s to {end} m at {end_v} m/s")
        marks = [stop for stop in stops if s <= stop[0] < end]
        square, slope = v * v, (end_v * end_v - v * v) / (end - s)
        for at, until in marks:
            if at > s:
                at_v = max(square + slope * (at - s), 0.0) ** 0.5
                time = _drive(legs, time, s, at, v, at_v)
                square, s, v = at_v * at_v, at, at_v
            time = max(time, until)
        time = _drive(legs, time, s, end, v, end_v)
    return Motion(*np.array(legs).T)


def _drive(legs, time, s, end, v, end_v):
    until = time + 2.0 * (end - s) / (v + end_v)
    legs.append((time, until, s, end, v, end_v))
    return until
