"""The staircases of all courses that robots may be driving, while courses come and go.

Every course has a number of its own.  A pair of robots may have several staircases: one for each
pair of their courses.  All of them count (design section 4.1).

Decides: which staircases count.  Must not know: how they are found, who may drive.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from coordinator.plan.staircases import NO_STAIRCASES, Indices, Milliseconds, Staircases


class CourseStaircases:
    """Staircases between courses, with the robots' numbers as indices."""

    def __init__(self, tau_ms: int) -> None:
        self._tau_ms = tau_ms
        self._all = NO_STAIRCASES
        self._courses: Indices = np.zeros((0, 2), np.int64)
        """The courses ahead and behind, one row for each staircase."""

    @property
    def all(self) -> Staircases:
        """All staircases that count, sorted by the robot behind, then the one ahead."""
        return self._all

    def add(self, found: Staircases, robots: Sequence[int], courses: Sequence[int]) -> None:
        """Add the staircases of a new course; their index k is robots[k] on courses[k]."""
        number, course = np.array(robots, np.int64), np.array(courses, np.int64)
        mine, new = self._all, np.column_stack((course[found.ahead], course[found.behind]))
        self._set(
            np.concatenate((mine.ahead, number[found.ahead])),
            np.concatenate((mine.behind, number[found.behind])),
            np.concatenate((np.diff(mine.first), np.diff(found.first))),
            np.concatenate((mine.at, found.at)),
            np.concatenate((mine.need, found.need)),
            np.concatenate((self._courses, new)),
        )

    def drop(self, courses: Collection[int]) -> None:
        """Drop the staircases of courses that are over, or that are never driven."""
        kept = ~np.isin(self._courses, list(courses)).any(axis=1)
        mine, sizes = self._all, np.diff(self._all.first)
        knots = np.repeat(kept, sizes)
        self._set(
            mine.ahead[kept],
            mine.behind[kept],
            sizes[kept],
            mine.at[knots],
            mine.need[knots],
            self._courses[kept],
        )

    def _set(
        self,
        ahead: Indices,
        behind: Indices,
        sizes: Indices,
        at: Milliseconds,
        need: Milliseconds,
        courses: Indices,
    ) -> None:
        order = np.lexsort((courses[:, 0], courses[:, 1], ahead, behind))
        begins = np.cumsum(sizes) - sizes
        first = np.append(0, np.cumsum(sizes[order]))
        rows = np.arange(first[-1]) + np.repeat(begins[order] - first[:-1], sizes[order])
        self._courses = courses[order]
        self._all = Staircases(
            self._tau_ms, ahead[order], behind[order], first, at[rows], need[rows]
        )
