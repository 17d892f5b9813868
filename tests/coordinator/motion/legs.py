"""The fastest motion from rest to rest on part of a path, for tests."""

import numpy as np

from coordinator.motion.profile_kernels import motion_knots


def speed_knots(limits, begin, end):
    """Return its knots (2, n): s [m] and v^2 [m^2/s^2]."""
    rests = np.array((begin, end), dtype=np.float64)
    return motion_knots(limits.ceiling, limits.in_short, rests, np.zeros(1))[0][:2]
