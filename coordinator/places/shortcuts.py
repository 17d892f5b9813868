"""Taking out places that moves need not pass: two moves of a robot become one straight one.

Decides: which moves are joined, and when the joined move comes.  Must not know: how moves were
found, curves, speeds and times.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from coordinator.curves.nurbs import Array
from coordinator.places.move_kernels import Indices

_PASSES: Final = 3

IsClear = Callable[[int, Array, Array], bool]
"""Whether a robot (index) can move on a straight line between two places (2,) [m]."""


@dataclass(frozen=True)
class Moves:
    """Moves in turn, each of a robot along a way (n, 2) [m].

    Robots stand at `starts` (robots, 2) [m] before; two of them have to be need[i, j] [m] apart.
    """

    robots: list[int]
    ways: list[Array]
    starts: Array
    need: Array


def straightened(moves: Moves, is_clear: IsClear) -> Moves:
    """Return moves that lead to the same places, in which fewer places are passed."""
    work = _Work(moves, is_clear)
    for _ in range(_PASSES):
        if not work.go_through():
            break
    kept = [k for k, way in enumerate(work.ways) if len(way)]
    robots, ways = [moves.robots[k] for k in kept], [work.ways[k] for k in kept]
    return Moves(robots, ways, moves.starts, moves.need)


class _Work:
    """Moves that are being joined: one that is gone has an empty way, and its legs have no robot.

    places (moves + 1, robots, 2) [m]: where everybody stands before each move.
    """

    def __init__(self, moves: Moves, is_clear: IsClear) -> None:
        self.moves, self.is_clear, self.ways = moves, is_clear, list(moves.ways)
        self.places = np.empty((len(self.ways) + 1, *moves.starts.shape))
        self.places[0] = moves.starts
        for k, (robot, way) in enumerate(zip(moves.robots, self.ways, strict=True)):
            self.places[k + 1] = self.places[k]
            self.places[k + 1, robot] = way[-1]
        self.first = np.cumsum([0, *(len(way) - 1 for way in self.ways)])
        self.legs = np.concatenate([np.hstack((way[:-1], way[1:])) for way in self.ways])
        self.whose: Indices = np.repeat(moves.robots, np.diff(self.first))
        self.of_robot: list[list[int]] = [[] for _ in moves.starts]
        for k, robot in enumerate(moves.robots):
            self.of_robot[robot].append(k)

    def go_through(self) -> bool:
        """Join moves of all robots where that is possible; return whether any were."""
        joined = False
        for robot, mine in enumerate(self.of_robot):
            k = 0
            while k + 1 < len(mine):
                one, two = mine[k : k + 2]
                kept = self._join(robot, one, two)
                if kept is None:
                    k += 1
                else:
                    mine[k : k + 2] = [kept]
                    joined = True
        return joined

    def _join(self, robot: int, one: int, two: int) -> int | None:
        """Join two moves of a robot; return at which of their turns it moves then, None if not."""
        start, end = self.ways[one][0], self.ways[two][-1]
        if np.hypot(*(end - start)) < 1e-9 or not self.is_clear(robot, start, end):
            return None
        for kept, rest in ((two, start), (one, end)):
            if self._keeps(robot, start, end, kept) and self._lets_pass(robot, rest, one, two):
                break
        else:
            return None
        gone = one + two - kept
        for k, way in ((gone, np.empty((0, 2))), (kept, np.stack((start, end)))):
            legs = slice(self.first[k], self.first[k + 1])
            self.ways[k], self.whose[legs] = way, -1
        self.legs[self.first[kept]] = np.concatenate((start, end))
        self.whose[self.first[kept]] = robot
        self.places[one + 1 : two + 1, robot] = start if kept == two else end
        return kept

    def _keeps(self, robot: int, start: Array, end: Array, turn: int) -> bool:
        """Return whether a move in this turn is clear of all others at rest."""
        others = self.places[turn]
        gaps = _gaps(others, np.concatenate((start, end))[None])
        tips = np.minimum(np.hypot(*(others - start).T), np.hypot(*(others - end).T))
        clear = (gaps >= self.moves.need[robot]) | (gaps > tips - 1e-9)
        clear[robot] = True
        return bool(clear.all())

    def _lets_pass(self, robot: int, place: Array, one: int, two: int) -> bool:
        """Return whether others' moves between two turns are clear of a robot at a place."""
        between = slice(self.first[one + 1], self.first[two])
        whose = self.whose[between]
        gaps = _gaps(place[None], self.legs[between])
        need = self.moves.need[robot][whose]
        return bool((gaps >= need)[(whose >= 0) & (whose != robot)].all())


def _gaps(points: Array, legs: Array) -> npt.NDArray[np.float64]:
    """Return the distances [m] between points (n, 2) and legs (m, 4); n or m is 1."""
    begin, along = legs[:, :2], legs[:, 2:] - legs[:, :2]
    size = np.maximum(np.einsum("ij,ij->i", along, along), 1e-18)
    share = np.clip(np.einsum("ij,ij->i", points - begin, along) / size, 0.0, 1.0)
    return np.asarray(np.hypot(*(points - begin - share[:, None] * along).T))
