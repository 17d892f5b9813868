"""The greatest v^2 that the bends of a curve allow, as a polyline that never exceeds it.

Bends limit a robot twice: by its acceleration across the path, v^2 k <= a, and by how fast it can
turn, v k <= w.  The polyline stays below the true limit between its samples too.  Decides: how
finely a curve is sampled for it.  Must not know: acceleration along the path, what is sent.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array, Nurbs
from coordinator.motion.speed_cap_kernels import bends, cells, finer, highest_bends

_ROUNDS: Final = 6
"""Greatest number of times that rough parts are sampled again, more finely."""

_RESERVE: Final = 0.998
"""Share of the limits that is used."""


def cap_on(curve: Nurbs, lateral: float, turning: float, top: float) -> tuple[Array, Array]:
    """Return s (n,) [m] from 0 to the length and v^2 (n,) [m^2/s^2] there, at most `top`.

    lateral [m/s^2] and turning [rad/s] may be infinite.  s never decreases; a place where knot
    spans meet occurs twice.
    """
    if math.isinf(lateral) and math.isinf(turning):
        return np.array((0.0, curve.length)), np.array((top, top))
    limit, turn = _RESERVE * lateral, _RESERVE * turning
    least = min(limit / top, turn / math.sqrt(top))
    u, inside = cells(np.unique(curve.knots))
    for left in range(_ROUNDS, -1, -1):
        _, first, second = curve.derivatives(u, 2)
        s = np.maximum.accumulate(curve.arc_at(u))
        s[-1] = curve.length
        bend, turned = bends(first, second)
        highest, rough = highest_bends(s, bend, turned, inside, least)
        if left == 0 or not rough.any():
            break
        u, inside = finer(u, inside, rough)
    cap = np.minimum(limit / highest, top)
    if math.isfinite(turn):
        # Between samples a line through 1 / k^2 lies above the square of that through 1 / k, by
        # the factor (k0 + k1)^2 / (4 k0 k1) at most (Kantorovich); it is lowered by that.
        k0, k1 = highest[:-1], highest[1:]
        share = np.where(inside, 4.0 * k0 * k1 / (k0 + k1) ** 2, 1.0)
        lowered = np.minimum(np.append(1.0, share), np.append(share, 1.0))
        cap = np.minimum(cap, turn * turn * lowered / highest**2)
    return s, cap
