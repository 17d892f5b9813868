"""Compiled: values between known places, for many places at a time.

Decides: what lies between knots.  Must not know: what the numbers stand for.
"""

from __future__ import annotations

import numpy as np

from coordinator.compiled import compiled
from coordinator.nurbs import Array


@compiled
def between(known: Array, values: Array, at: Array) -> Array:
    """Return the values (m,) at places (m,), linear between known ones (n,) that never decrease.

    Where known places repeat, the value before them counts up to there.
    """
    found = np.empty(len(at))
    for i in range(len(at)):
        k = min(max(int(np.searchsorted(known, at[i])), 1), len(known) - 1)
        size = known[k] - known[k - 1]
        part = (at[i] - known[k - 1]) / size if size > 0.0 else 0.0
        found[i] = values[k - 1] + min(max(part, 0.0), 1.0) * (values[k] - values[k - 1])
    return found
