"""The stub course of an idle robot: so short that the robot stands where it is, yet a path.

An idle robot arms, sets out and arrives as all others do, and the proof covers it like them.

Decides: which way a stub leads.  Must not know: floors, other robots, times.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array, Nurbs, nurbs
from coordinator.scenario.model import Robot

_LENGTH: Final = 7e-4
"""Length [m] of a stub.  Both of its ends are the scenario's start and goal for the proof, to which
places within 1 mm are the same; and 8 km from the origin float32 still tells them apart."""

_DIRECTIONS: Final = 16
"""How many directions are tried for a robot without a heading."""

_AMPLE: Final = 3e-3
"""A line with this much room to spare [m] is taken at once: two stubs that lead towards each other
still leave what the planner adds to needs."""


def stub(robot: Robot, spare: Callable[[Array], float]) -> Nurbs:
    """Return the stub of an idle robot; `spare` [m]: how much room a place (2,) has to spare.

    It leads straight ahead of the robot, or from behind it to its place if that has more room.
    Without a heading it leads along +x, or in another direction that has more room.
    """
    heading = (*robot.start[2:], *robot.goal[2:])[:1]
    angles = heading or [math.tau * turn / _DIRECTIONS for turn in range(_DIRECTIONS)]
    place = np.array(robot.start[:2])
    steps = [_LENGTH * np.array((math.cos(angle), math.sin(angle))) for angle in angles]
    lines = [(place, place + step) for step in steps]
    lines += [(place - step, place) for step in steps if heading]
    best, most = lines[0], -math.inf
    for line in lines:
        room = min(map(spare, line))
        if room > most:
            best, most = line, room
        if most >= _AMPLE:
            break
    knots = np.array((0.0, 0.0, _LENGTH, _LENGTH), dtype=np.float32)
    return nurbs(1, knots, np.array(best, dtype=np.float32))
