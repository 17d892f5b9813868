"""The staircases between all courses that robots may be driving, while courses come and go.

Decides: which staircases count.  Must not know: how they are found, who drives which course.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from coordinator.plan.staircases import Indices, Milliseconds, Staircases


class CourseStaircases:
    """Staircases between courses; a pair of robots has one for each pair of their courses."""

    def __init__(self, staircases: Staircases) -> None:
        self._all = staircases

    @property
    def all(self) -> Staircases:
        """All staircases that count, sorted by the course behind, then the one ahead."""
        return self._all

    def among(self, courses: Sequence[int]) -> Staircases:
        """Return the staircases between these courses; courses[k] has the index k there."""
        mine = self._all
        index = np.full(1 + max([*courses, *mine.ahead, *mine.behind], default=0), -1, np.int64)
        index[list(courses)] = np.arange(len(courses))
        rows = _Rows.of(mine, index[mine.ahead], index[mine.behind])
        return rows.those((rows.ahead >= 0) & (rows.behind >= 0)).sorted(mine.tau_ms)

    def of(self, course: int) -> Staircases:
        """Return the staircases between a course and all others."""
        mine = self._all
        rows = _Rows.of(mine, mine.ahead, mine.behind)
        return rows.those((rows.ahead == course) | (rows.behind == course)).sorted(mine.tau_ms)

    def put(self, course: int, found: Staircases, courses: Sequence[int]) -> None:
        """Replace all staircases of a course by others; their index k is courses[k].

        Those with a course of -1, which is driven no more, are left out.
        """
        number, mine = np.array(courses, np.int64), self._all
        old = _Rows.of(mine, mine.ahead, mine.behind)
        new = _Rows.of(found, number[found.ahead], number[found.behind])
        old = old.those((old.ahead != course) & (old.behind != course))
        new = new.those((new.ahead >= 0) & (new.behind >= 0))
        self._all = old.and_those(new).sorted(found.tau_ms or mine.tau_ms)


def joined(one: Staircases, other: Staircases, further: int) -> Staircases:
    """Return the staircases of a course, index 0, with the courses of both.

    Those of `other` have indices greater by `further`.
    """
    ahead, behind = (np.where(k > 0, k + further, 0) for k in (other.ahead, other.behind))
    rows = _Rows.of(one, one.ahead, one.behind).and_those(_Rows.of(other, ahead, behind))
    return rows.sorted(other.tau_ms or one.tau_ms)


class _Rows(NamedTuple):
    """Staircases one by one: ahead, behind, number of knots (n,), and all knots (k,) [ms]."""

    ahead: Indices
    behind: Indices
    sizes: Indices
    at: Milliseconds
    need: Milliseconds

    @classmethod
    def of(cls, staircases: Staircases, ahead: Indices, behind: Indices) -> _Rows:
        sizes = np.diff(staircases.first)
        return cls(ahead, behind, sizes, staircases.at, staircases.need)

    def those(self, kept: npt.NDArray[np.bool_]) -> _Rows:
        knots = np.repeat(kept, self.sizes)
        return _Rows(
            self.ahead[kept],
            self.behind[kept],
            self.sizes[kept],
            self.at[knots],
            self.need[knots],
        )

    def and_those(self, others: _Rows) -> _Rows:
        return _Rows(
            np.concatenate((self.ahead, others.ahead)),
            np.concatenate((self.behind, others.behind)),
            np.concatenate((self.sizes, others.sizes)),
            np.concatenate((self.at, others.at)),
            np.concatenate((self.need, others.need)),
        )

    def sorted(self, tau_ms: int) -> Staircases:
        """Return the staircases by the course behind, then the one ahead."""
        order = np.lexsort((self.ahead, self.behind))
        sizes = self.sizes[order]
        begins = (np.cumsum(self.sizes) - self.sizes)[order]
        first = np.append(0, np.cumsum(sizes))
        rows = np.arange(first[-1]) + np.repeat(begins - first[:-1], sizes)
        at, need = self.at[rows], self.need[rows]
        return Staircases(tau_ms, self.ahead[order], self.behind[order], first, at, need)
