"""The margin: everything that may bring two robots nearer to each other than in their plans.

Decides: the shares of the margin, and how far from its planned place a robot may be, such that
their sum is at most the margin.  A plan keeps two centres r_i + r_j + margin apart; everything that
uses up part of that margin has a share here.  Must not know: plans, messages.

Deviations in time alone (lateness, clocks) have shares of tau instead (plan/fault_budget.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

TOLERANCE: Final = 1e-3
"""The proof accepts a plan whose distances are short of the margin by at most this [m], so that no
valid plan is refused because of rounding."""

RESOLUTION: Final = 2.5e-4
"""The proof computes the least distance of two motions with at most this error [m]."""

SAME: Final = 1e-4
"""A robot may change over in motion between two courses that are apart by at most this [m]: where
it is, and what it has passed, counts for both."""

ARC_ERROR: Final = 2.5e-4
"""A robot's own table of arc lengths places it at most this far [m] from its place in the proof."""

LEAST_TRACK_MM: Final = 2
"""The least track tolerance: a robot arrives up to 1 mm short of its goal and 1 mm beside it."""


@dataclass(frozen=True)
class MarginShares:
    """Shares of the margin, all in metres."""

    proof: float
    """By how much the true distance may be less than the distance that the proof requires, between
    two courses of each robot included: both may be about to change."""
    arcs: float
    """The errors of the tables of arc lengths of the robots concerned."""
    tracking: float
    """How far these robots may truly be from where their plans have them."""

    @property
    def total(self) -> float:
        """The least margin [m] that covers all shares."""
        return self.proof + self.arcs + self.tracking


def between_robots(track_mm: int, other_mm: int) -> MarginShares:
    """Return the shares for two robots with these track tolerances [mm]."""
    tracking = (track_mm + other_mm) / 1000.0
    return MarginShares(TOLERANCE + RESOLUTION + 2.0 * SAME, 2.0 * ARC_ERROR, tracking)


def beside_solid(track_mm: int) -> MarginShares:
    """Return the shares for a robot beside something solid; its planned clearance is proven."""
    return MarginShares(TOLERANCE + SAME, ARC_ERROR, track_mm / 1000.0)


LEAST_MARGIN: Final = between_robots(LEAST_TRACK_MM, LEAST_TRACK_MM).total


def track_mm_for(margin: float) -> int:
    """Return the track tolerance [mm] that a margin [m] leaves each robot.

    Whole millimetres; 0 if nothing is left.
    """
    left = margin - between_robots(0, 0).total
    track = max(math.ceil(500.0 * left), 0)
    while track and between_robots(track, track).total > margin:
        track -= 1
    return track


def margin_for(track_mm: int) -> float:
    """Return the least margin [m], in whole millimetres, that gives each robot `track_mm` [mm]."""
    return math.ceil(1000.0 * between_robots(track_mm, track_mm).total) / 1000.0
