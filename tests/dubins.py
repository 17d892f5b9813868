"""The shortest way of a car from pose to pose (Dubins 1957), found by trying all first turns."""

import math

import numpy as np

FULL = 2.0 * math.pi
TURNS = np.linspace(0.0, FULL, 20_001)


def center(x, y, heading, side, radius):
    return x - side * radius * np.sin(heading), y + side * radius * np.cos(heading)


def crossings(values):
    """Where the values change their sign without a jump."""
    changes = np.sign(values[:-1]) != np.sign(values[1:])
    return np.flatnonzero(changes & (np.abs(np.diff(values)) < 0.1))


def dubins_length(start, goal, radius):
    """Return the length [m] of the shortest way with turns of a radius [m] or wider."""
    best = math.inf
    for first in (1, -1):
        cx, cy = center(*start, first, radius)
        heading = start[2] + first * TURNS
        x, y = cx + first * radius * np.sin(heading), cy - first * radius * np.cos(heading)
        for last in (1, -1):
            gx, gy = center(*goal, last, radius)
            turned = (last * (goal[2] - heading)) % FULL
            dx = gx + last * radius * np.sin(heading) - x
            dy = gy - last * radius * np.cos(heading) - y
            along = dx * np.cos(heading) + dy * np.sin(heading)
            across = dy * np.cos(heading) - dx * np.sin(heading)
            length = radius * (TURNS + turned) + along
            found = crossings(across)
            best = min(best, *length[found[along[found] > -1e-3]], math.inf)
        # The middle circle touches the first one, where it is left, and the last one.
        mx, my = center(x, y, heading, -first, radius)
        gx, gy = center(*goal, first, radius)
        found = crossings(np.hypot(gx - mx, gy - my) - 2.0 * radius)
        onward = np.arctan2(gy - my, gx - mx) - first * 0.5 * math.pi
        middle = (first * (heading - onward)) % FULL
        turned = (first * (goal[2] - onward)) % FULL
        best = min(best, *(radius * (TURNS + middle + turned))[found], math.inf)
    return best
