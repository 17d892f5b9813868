"""Compiled: the table of arc lengths that a robot computes for its path.

Decides: nothing; a test checks that the table is that of protocol/curve.py.  Must not know:
messages.
"""

from __future__ import annotations

import numpy as np

from coordinator.base.compiled import compiled
from coordinator.curves.nurbs_kernels import SPEED, ArcTable, Array, measure

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


@compiled
def robot_table(borders: Array, powers: Array, cells: int) -> ArcTable:
    """Return the robot's arc-length table of a curve's Series, with `cells` cells per span.

    The robot keeps du/ds as float32.  Each cell is measured by Gauss quadrature with 5 nodes; cells
    without length are left out.
    """
    size = cells * len(powers) + 1
    u, s, slope = np.zeros(size), np.zeros(size), np.empty(size)
    offsets, work = np.empty(len(_NODES) + 1), np.empty((6, len(_NODES) + 1))
    count, grown = 0, True
    for span in range(len(powers)):
        step = (borders[span + 1] - borders[span]) / cells
        middle = borders[span] + 0.5 * (borders[span + 1] - borders[span])
        for cell in range(cells):
            u0 = borders[span] + cell * step
            u1 = borders[span + 1] if cell == cells - 1 else u0 + step
            offsets[:-1] = 0.5 * (u0 + u1) + 0.5 * (u1 - u0) * _NODES - middle
            offsets[-1] = u0 - middle
            measure(powers[span], offsets, work)
            if grown:
                slope[count] = np.float32(1.0 / max(work[SPEED, -1], 1e-9))
            length = 0.5 * (u1 - u0) * np.sum(_WEIGHTS * work[SPEED, :-1])
            grown = length > 0.0
            if grown:
                count += 1
                u[count], s[count] = u1, s[count - 1] + length
    if grown:
        offsets[-1] = 0.5 * (borders[-1] - borders[-2])
        measure(powers[-1], offsets, work)
        slope[count] = np.float32(1.0 / max(work[SPEED, -1], 1e-9))
    return ArcTable(u[: count + 1], s[: count + 1], slope[: count + 1])
