"""The greatest v^2 that the bends of a curve allow, as a polyline that never exceeds it.

The polyline stays below the true limit between its samples too.  Decides: how finely a curve is
sampled for it.  Must not know: acceleration along the path, what is sent.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from coordinator.curves.nurbs import Array, Nurbs
from coordinator.motion.speed_cap_kernels import bends, cells, finer, highest_bends

_ROUNDS: Final = 6
"""Greatest number of times that rough parts are sampled again, more finely."""

_RESERVE: Final = 0.998
"""Share of the lateral limit that is used."""


def cap_on(curve: Nurbs, lateral: float, top: float) -> tuple[Array, Array]:
    """Return s (n,) [m] from 0 to the length and v^2 (n,) [m^2/s^2] there, at most `top`.

    lateral [m/s^2] is finite.  s never decreases; a place where knot spans meet occurs twice.
    """
    limit = _RESERVE * lateral
    u, inside = cells(np.unique(curve.knots))
    for left in range(_ROUNDS, -1, -1):
        _, first, second = curve.derivatives(u, 2)
        s = np.maximum.accumulate(curve.arc_at(u))
        s[-1] = curve.length
        bend, turned = bends(first, second)
        highest, rough = highest_bends(s, bend, turned, inside, limit / top)
        if left == 0 or not rough.any():
            break
        u, inside = finer(u, inside, rough)
    return s, np.minimum(limit / highest, top)
