"""Follows how far in its plan a robot has come, from the lateness in its reports.

Decides: what counts as on time, and what is assumed between reports and after the last one.  Must
not know: paths, logs, pictures.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import Final

import numpy as np

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Knot = tuple[float, float]
"""A time of the plan, and the plan time that the robot has passed then [s]."""

ON_TIME: Final = 0.15
"""A robot that is late by no more than this [s] is shown on time."""

_UNHEARD: Final = 1.0
"""A robot that is late when it is heard again after a silence this long [s] is assumed to have
driven by the clock until its authority ended, and to have stood since then."""


class Progress:
    """The plan time that a robot has passed, over the time of the plan; both [s].

    It is linear between `knots`.  Before the first one the robot is on time.  After the last one it
    goes on as between the last two, but no faster than the clock.
    """

    def __init__(self) -> None:
        self.knots: list[Knot] = []
        self._before = 0.0

    @property
    def is_late(self) -> bool:
        """Whether the robot was late when it was last heard."""
        return bool(self.knots) and self.knots[-1][1] < self.knots[-1][0]

    def take(self, t: float, late: float, granted: float = 0.0) -> None:
        """Take in a report made at a time of the plan: how late the robot was [s], at most.

        `granted`: the plan time [s] up to which it may have driven while it was not heard, if it
        may be further than it says.
        """
        if self.knots and t <= self.knots[-1][0]:
            return
        was_late = self.is_late
        if late > ON_TIME:
            if not was_late and (not self.knots or self._before > self.knots[-1][0]):
                self.knots.append((self._before, self._before))
            if t - self._before > _UNHEARD:
                before, passed = self.knots[-1]
                driven = min(granted, passed + self._rate() * (t - before))
                stood = before + max(max(t - late, driven) - passed, 0.0)
                if before < stood < t:
                    self._add(stood, max(t - late, driven))
            self._add(t, t - late)
        elif was_late:
            self._add(t, t)
        self._before = t

    def stops(self, t: float, passed: float) -> Progress:
        """Return the progress of a robot that rests from t on, where its plan is at `passed`.

        After that it counts on with the clock, so that it passes the end of the robot's motion.
        """
        found = Progress()
        found.knots = [knot for knot in self.knots if knot[0] < t and knot[1] <= passed]
        found.knots += [(t, passed), (t + 1.0, passed + 1.0)]
        return found

    def at(self, times: Array) -> Array:
        """Return what the robot has passed at times of the plan (n,)."""
        if not self.knots:
            return times
        t, passed = np.array(self.knots).T
        inside = np.interp(times, t, passed)
        after = passed[-1] + self._rate() * (times - t[-1])
        return np.where(times < t[0], times, np.where(times > t[-1], after, inside))

    def when(self, passed: float) -> float:
        """Return when the robot has come so far; the time of the last knot if it never does."""
        if not self.knots or passed <= self.knots[0][1]:
            return passed
        after = bisect_left(self.knots, passed, key=lambda knot: knot[1])
        if after == len(self.knots):
            (t, known), rate = self.knots[-1], self._rate()
            return t + (passed - known) / rate if rate > 0.0 else t
        (t0, p0), (t1, p1) = self.knots[after - 1 : after + 1]
        return t0 + (t1 - t0) * (passed - p0) / (p1 - p0)

    def _add(self, t: float, passed: float) -> None:
        """Add a knot; one between two others on the same line is left out."""
        knots = self.knots
        passed = max(passed, knots[-1][1]) if knots else passed
        if len(knots) > 1:
            (t0, p0), (t1, p1) = knots[-2:]
            if abs((p1 - p0) * (t - t1) - (passed - p1) * (t1 - t0)) < 1e-9:
                knots.pop()
        knots.append((t, passed))

    def _rate(self) -> float:
        if len(self.knots) < 2:
            return 1.0
        (t0, p0), (t1, p1) = self.knots[-2:]
        return min(max((p1 - p0) / (t1 - t0), 0.0), 1.0)
