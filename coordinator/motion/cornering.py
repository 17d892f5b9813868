"""How a robot takes corners: the radii that follow from its limits.

Decides: which radii are useful.  Must not know: polygons and curves.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from coordinator.curves.nurbs import Nurbs
from coordinator.ground.corner_kernels import Limits
from coordinator.motion.velocity_profile import least_time

_EASY_RADIUS = 0.1
"""Robots without a limit on lateral acceleration get corners of this radius [m] where they fit."""
_WIDEST_RADIUS = 5.0
_RESERVE = 1.05
"""Factor by which the radii of corners exceed `min_turn_radius`."""


@dataclass(frozen=True)
class Handling:
    """Speed [m/s], accelerations [m/s^2], turn rate [rad/s] (inf: no limit) and least radius [m].

    `spent_per_corner` [m]: how much longer a way may be if it has one corner less.
    """

    speed: float = 1.0
    accel: float = math.inf
    lateral: float = math.inf
    turning: float = math.inf
    min_turn_radius: float = 0.0
    spent_per_corner: float = 0.0

    @property
    def tightest(self) -> float:
        """Radius [m] that every corner should have."""
        return _RESERVE * self.min_turn_radius

    @property
    def easy(self) -> float:
        """Radius [m] at which a corner costs no speed; a wider one gains nothing."""
        free = max(self.speed**2 / self.lateral, self.speed / self.turning)
        return max(min(max(free, _EASY_RADIUS), _WIDEST_RADIUS), self.tightest)

    def least_time(self, curve: Nurbs) -> float:
        """Return the least time [s] that a curve takes, from rest to rest."""
        return least_time(curve, self.speed, self.accel, self.lateral, self.turning)

    def numbers(self) -> Limits:
        """Return these limits as the kernels of corners need them."""
        worth = self.spent_per_corner / self.speed
        return Limits(
            float(self.speed),
            float(self.accel),
            float(self.lateral),
            float(self.turning),
            float(self.easy),
            float(self.tightest),
            float(worth),
        )
