"""Compiled: interpolation between the knots of a table, for many places at a time.

Decides: which values and times lie between knots.  Must not know: whose path it is.
"""

from __future__ import annotations

import math

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs import Array


@compiled
def between(known: Array, values: Array, at: Array) -> Array:
    """Return the values at places `at` (m,), linear between `values` (n,) at places `known` (n,).

    `known` must not decrease.  Where it has equal entries, the first of their values is returned.
    Outside `known` the nearest value is returned.
    """
    found = np.empty(len(at))
    for i in range(len(at)):
        k = min(max(int(np.searchsorted(known, at[i])), 1), len(known) - 1)
        size = known[k] - known[k - 1]
        part = (at[i] - known[k - 1]) / size if size > 0.0 else 0.0
        found[i] = values[k - 1] + min(max(part, 0.0), 1.0) * (values[k] - values[k - 1])
    return found


@compiled
def times_at(knots_s: Array, knots_w: Array, s: Array) -> Array:
    """Return the times (m,) [s] from the first knot to arc lengths s (m,) [m] between the knots.

    knots_s (n,) [m]; knots_w (n,) [m^2/s^2]: v^2 at the knots, linear in s between them.
    """
    begun = np.zeros(len(knots_s))
    for k in range(1, len(knots_s)):
        both = math.sqrt(knots_w[k - 1]) + math.sqrt(knots_w[k])
        begun[k] = begun[k - 1] + 2.0 * (knots_s[k] - knots_s[k - 1]) / both
    found = np.empty(len(s))
    for i in range(len(s)):
        leg = int(np.searchsorted(knots_s, s[i], side="right")) - 1
        leg = min(max(leg, 0), len(knots_s) - 2)
        low, high, passed = knots_w[leg], knots_w[leg + 1], s[i] - knots_s[leg]
        part = passed / (knots_s[leg + 1] - knots_s[leg])
        both = math.sqrt(low) + math.sqrt(max(low + part * (high - low), 0.0))
        found[i] = begun[leg] + 2.0 * passed / (both if both > 0.0 else 1.0)
    return found
