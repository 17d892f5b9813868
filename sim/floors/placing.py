"""Starts, goals and via points for the robots of a floor, none of which blocks another robot.

Decides: the places.  Each robot has a way from its start to its goal that avoids the starts and
goals of all others, so that the robots can drive in any order.  Must not know: kinds, files.
"""

from __future__ import annotations

import math
from random import Random
from typing import Final

import numpy as np

from coordinator.base.errors import InputError
from coordinator.scenario.model import Point, Pose
from sim.floors.free_space import Exits, find_exits, free_space
from sim.floors.layout import Box, Layout, Region, Trip, Wish
from sim.floors.spread import Spread

PASSING: Final = 0.01
"""Ways stay away from other robots' places by the need of two robots plus this distance [m]."""
ROUNDS: Final = 12
"""How often robots without a way out are placed again."""
TRIES: Final = 1_000
"""Random starts and goals that are tried for a robot before the floor counts as full."""
VIA_TRIES: Final = 100
"""Random places tried per via point in the box of start and goal, and then on the whole floor."""
VIA_ROOM: Final = 2.0
"""Via points are first tried in the box of start and goal, grown by this distance [m]."""
NEXT: Final = 0.5
"""Consecutive places on a robot's way are at least this far [m] from each other."""


class Places:
    """The starts and goals of all robots of a wish, on one floor."""

    def __init__(self, layout: Layout, wish: Wish, dice: Random) -> None:
        self._layout = layout
        self._wish = wish
        self._dice = dice
        self._free = free_space(layout.floor, wish.reach)
        self._taken = Spread(wish.apart)
        self._keep = wish.need + PASSING
        self.trips: list[tuple[Point, Point]] = []
        self.exits = self._settle()

    def _settle(self) -> Exits:
        """Place the robots, and place those without a way out again; InputError when some remain.

        Robots rarely lack a way out: only where a gap is narrower than the fan of exits resolves.
        """
        wanted = self._wish.robots
        found: dict[int, tuple[Point, Point]] = {}
        for _ in range(ROUNDS):
            full = not self._fill(found)
            found = dict(sorted(found.items()))
            exits = find_exits(self._free, list(found.values()), self._keep)
            lost = [index for at, index in enumerate(found) if not exits.common(at).size]
            if not lost and not full:
                self.trips = list(found.values())
                return exits
            for index in lost:
                for place in found.pop(index):
                    self._taken.remove(*place, 0.0)
            if full:
                break
        xs, ys = zip(*self._layout.floor.boundary, strict=True)
        floor = f"this floor of {max(xs) - min(xs):.4g} m x {max(ys) - min(ys):.4g} m"
        raise InputError([f"--robots: {wanted} do not fit on {floor}, only {len(found)} do"])

    def _fill(self, found: dict[int, tuple[Point, Point]]) -> bool:
        """Find places for all robots that have none; return False if a robot finds none."""
        trips = self._layout.trips
        for index in range(self._wish.robots):
            if index not in found:
                trip = self._find(trips[index % len(trips)])
                if trip is None:
                    return False
                found[index] = trip
        return True

    def _find(self, trip: Trip) -> tuple[Point, Point] | None:
        """Reserve a random start and goal in one free piece of the floor; None if there is none."""
        for _ in range(TRIES):
            start, goal = trip.starts.draw(self._dice), trip.goals.draw(self._dice)
            if (
                math.dist(start, goal) >= max(self._layout.least_trip, self._wish.apart)
                and self._joined(start, goal)
                and self._fits(start)
                and self._fits(goal)
            ):
                self._taken.add(*start, 0.0)
                self._taken.add(*goal, 0.0)
                return start, goal
        return None

    def _fits(self, place: Point) -> bool:
        apart = self._taken.fits(*place, self._wish.apart)
        return apart and self._free.leaves_a_way(place, self._keep)

    def _joined(self, start: Point, goal: Point) -> bool:
        one, other = self._free.at(np.array((start, goal)))
        return bool(one == other >= 0)

    def way(self, robot: int, vias: int, headings: bool) -> tuple[Pose, tuple[Point, ...], Pose]:
        """Return start, via points and goal of a robot; poses have headings if `headings`.

        Via points lie on the same piece of the ground as the way from start to goal, and are sorted
        by how far they lie in the direction from start to goal.  Headings lead straight out of the
        start and straight into the goal.
        """
        start, goal = self.trips[robot]
        pieces = self.exits.common(robot)
        piece = int(pieces[self._dice.randrange(len(pieces))])
        via = self._vias(start, goal, vias, piece)
        if not headings:
            return start, via, goal
        out = self._dice.choice(self.exits.headings(2 * robot, piece))
        into = self._dice.choice(self.exits.headings(2 * robot + 1, piece)) + math.pi
        return (
            (*start, round(out, 3) + 0.0),
            via,
            (*goal, round(math.remainder(into, math.tau), 3) + 0.0),
        )

    def _vias(self, start: Point, goal: Point, count: int, piece: int) -> tuple[Point, ...]:
        """Return via points on one piece of the ground; InputError when there is no room."""
        xs, ys = zip(*self._layout.floor.boundary, strict=True)
        whole = Region(Box(min(xs), min(ys), max(xs), max(ys)))
        near = Region(Box(*map(min, start, goal), *map(max, start, goal)).grown(VIA_ROOM))
        along = goal[0] - start[0], goal[1] - start[1]
        found: list[Point] = []
        for attempt in range(2 * VIA_TRIES * count):
            if len(found) == count:
                break
            via = (near if attempt < VIA_TRIES * count else whole).draw(self._dice)
            apart = all(math.dist(via, other) >= NEXT for other in (start, goal, *found))
            if apart and self.exits.ground.at(np.array([via]))[0] == piece:
                found.append(via)
        if len(found) < count:
            raise InputError([f"--vias: a robot has room for {len(found)}, not for {count}"])
        found.sort(key=lambda via: (via[0] * along[0] + via[1] * along[1], via))
        return tuple(found)
