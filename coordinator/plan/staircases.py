"""Staircases: how far one robot must have driven before another one may drive on.

For an ordered pair of robots, the one ahead and the one behind, `need(t)` is a plan time: before
the robot behind may be at plan time t, the robot ahead must have passed plan time need(t)
(design section 1).  It never falls.  It is kept as a polyline over t that never lies below the true
staircase; within tau of each other robots need no staircase at all.

Decides: how staircases are kept and read.  Must not know: how they are found, who may drive.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np
import numpy.typing as npt

Milliseconds = npt.NDArray[np.int32]
Indices = npt.NDArray[np.int64]

NOTHING: Final = -(2**31)
"""The need [ms] before the first knot of a staircase: nothing has to have been passed."""


@dataclass(frozen=True, eq=False)
class Staircases:
    """The staircases of a plan's ordered pairs, sorted by the robot behind, then the one ahead.

    ahead, behind (n,): indices of robots.  Staircase k has the knots first[k] to first[k + 1] of
    `at` and `need` [ms of plan time]; both never fall along its knots.  Before the first knot the
    need is NOTHING, after the last knot it stays.  `tau_ms`: robots are proven to keep clear while
    their plan times differ by no more than this.
    """

    tau_ms: int
    ahead: Indices
    behind: Indices
    first: Indices
    at: Milliseconds
    need: Milliseconds

    def need_at(self, pair: int, time: float) -> float:
        """Return the need of a pair [ms] at a plan time [ms]; -inf where there is none."""
        knots = slice(self.first[pair], self.first[pair + 1])
        at, need = self.at[knots], self.need[knots]
        if not len(at) or time < at[0]:
            return -np.inf
        k = int(np.searchsorted(at, time, side="right")) - 1
        if k == len(at) - 1:
            return float(need[k])
        rise = (time - at[k]) / (at[k + 1] - at[k])
        return min(float(need[k] + rise * (need[k + 1] - need[k])), time - self.tau_ms)

    def knots_of(self, pair: int) -> npt.NDArray[np.int32]:
        """Return the knots (k, 2) of one staircase: t, need [ms]."""
        knots = slice(self.first[pair], self.first[pair + 1])
        return np.column_stack((self.at[knots], self.need[knots]))


class PlainStaircases(msgspec.Struct, frozen=True):
    """Staircases as plain data: the bytes of their arrays."""

    tau_ms: int
    ahead: bytes
    behind: bytes
    first: bytes
    at: bytes
    need: bytes

    @classmethod
    def of(cls, staircases: Staircases) -> PlainStaircases:
        """Return staircases as plain data."""
        arrays = ("ahead", "behind", "first", "at", "need")
        return cls(staircases.tau_ms, *(getattr(staircases, name).tobytes() for name in arrays))

    def staircases(self) -> Staircases:
        """Return the staircases."""
        ahead, behind, first = (
            np.frombuffer(one, np.int64).copy() for one in (self.ahead, self.behind, self.first)
        )
        at, need = (np.frombuffer(one, np.int32).copy() for one in (self.at, self.need))
        return Staircases(self.tau_ms, ahead, behind, first, at, need)


def _none() -> Staircases:
    numbers, times = np.zeros(0, np.int64), np.zeros(0, np.int32)
    return Staircases(0, numbers, numbers, np.zeros(1, np.int64), times, times)


NO_STAIRCASES: Final = _none()
"""Those of robots that never come near each other."""
