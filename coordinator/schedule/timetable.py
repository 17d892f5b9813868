"""The motions of a fleet side by side, as arrays that kernels read.

Decides: how motions are laid out, and which robots have one.  Must not know: zones or orders.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from coordinator.curves.nurbs import Array
from coordinator.motion.velocity_profile import Motion
from coordinator.schedule.forbidden_interval_kernels import Timetable

_KNOTS = 32
_SERIALS = itertools.count(1)


class Motions:
    """One motion per robot, or none yet; lengths (n,) [m] are those of the paths."""

    def __init__(self, lengths: Sequence[float], found: Sequence[Motion] = ()) -> None:
        count = len(lengths)
        self.found: list[Motion | None] = [None] * count
        self.placed: npt.NDArray[np.bool_] = np.zeros(count, dtype=np.bool_)
        self.table = _empty(count, _KNOTS, np.array(lengths, dtype=np.float64))
        for index, motion in enumerate(found):
            self.put(index, motion)

    def put(self, index: int, motion: Motion | None, serial: int | None = None) -> None:
        """Set or remove a robot's motion; `serial`: the number of a motion that is restored."""
        self.found[index] = motion
        self.table.serial[index] = next(_SERIALS) if serial is None else serial
        self.placed[index] = motion is not None
        if motion is not None:
            self._set(index, motion.knots_s, motion.knots_w, motion.knots_t)

    def put_legs(self, index: int, legs: Array) -> None:
        """Set a robot's motion to one that it was sent; `legs` (6, n) as Driven has them."""
        self.table.serial[index], self.placed[index] = next(_SERIALS), True
        t, s, v = legs.reshape(3, 2, -1).swapaxes(1, 2).reshape(3, -1)
        self._set(index, s, v * v, t)

    def _set(self, index: int, s: Array, w: Array, t: Array) -> None:
        size = len(s)
        if size > self.table.s.shape[1]:
            self._widen(2 * size)
        table = self.table
        table.s[index, :size], table.w[index, :size], table.t[index, :size] = s, w, t
        table.knots[index] = size

    def all(self) -> list[Motion]:
        """Return every robot's motion; ValueError when one has none."""
        found = [motion for motion in self.found if motion is not None]
        if len(found) < len(self.found):
            raise ValueError(f"{len(self.found) - len(found)} robots have no motion")
        return found

    def _widen(self, knots: int) -> None:
        old, count = self.table, len(self.found)
        self.table = _empty(count, knots, old.length)
        width = old.s.shape[1]
        for new, kept in ((self.table.s, old.s), (self.table.w, old.w), (self.table.t, old.t)):
            new[:, :width] = kept
        self.table.knots[:], self.table.serial[:] = old.knots, old.serial


def _empty(count: int, knots: int, length: npt.NDArray[np.float64]) -> Timetable:
    s, w, t = np.zeros((3, count, knots))
    return Timetable(s, w, t, np.zeros(count, np.int64), np.zeros(count, np.int64), length)
