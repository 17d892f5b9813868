"""The margin: what may bring two robots nearer to each other than their plans have them.

Decides: the shares of the margin, and how far off its plan a robot may be, so that their sum is the
margin at most.  A plan keeps two centres r_i + r_j + margin apart; whatever uses up that margin has
a share here.  Must not know: plans, messages.

What only time pulls apart (lateness, clocks) is a share of tau (plan/fault_budget.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

TOLERANCE: Final = 1e-3
"""The proof accepts a plan that is short of the margin by this [m]: rounding refuses no valid
plan."""

RESOLUTION: Final = 2.5e-4
"""The proof knows the least distance of two motions to this [m]."""

ARC_ERROR: Final = 2.5e-4
"""A robot's own table of arc lengths places it at most this far [m] from where the proof has it."""

LEAST_TRACK_MM: Final = 2
"""No robot drives with less: it arrives up to 1 mm short of its goal and up to 1 mm beside it."""


@dataclass(frozen=True)
class MarginShares:
    """Shares of the margin, all in metres."""

    proof: float
    """By how much the true distance may be less than the proof asks for."""
    arcs: float
    """Tables of arc lengths of the robots concerned."""
    tracking: float
    """How far these robots may truly be from where their plans have them."""

    @property
    def total(self) -> float:
        """What the margin has to be at least [m]."""
        return self.proof + self.arcs + self.tracking


def between_robots(track_mm: int, other_mm: int) -> MarginShares:
    """Return the shares for two robots that may be so far off their plans."""
    tracking = (track_mm + other_mm) / 1000.0
    return MarginShares(TOLERANCE + RESOLUTION, 2.0 * ARC_ERROR, tracking)


def beside_solid(track_mm: int) -> MarginShares:
    """Return the shares for a robot beside something solid, whose clearance is certified."""
    return MarginShares(TOLERANCE, ARC_ERROR, track_mm / 1000.0)


LEAST_MARGIN: Final = between_robots(LEAST_TRACK_MM, LEAST_TRACK_MM).total


def track_mm_for(margin: float) -> int:
    """Return how far [mm] each robot may be off its plan: whole millimetres, 0 when none is left.

    margin [m].
    """
    left = margin - between_robots(0, 0).total
    track = max(math.ceil(500.0 * left), 0)
    while track and between_robots(track, track).total > margin:
        track -= 1
    return track


def margin_for(track_mm: int) -> float:
    """Return the least margin [m], in whole millimetres, that leaves each robot so much [mm]."""
    return math.ceil(1000.0 * between_robots(track_mm, track_mm).total) / 1000.0
