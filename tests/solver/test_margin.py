"""The sum of the margin, with every share a free variable.

True places lie beside the courses that are driven, those beside the courses that are proven, and so
on: each share is a vector of bounded length.  Along the line between two robots, what every share
takes from the distance is a number between plus and minus its bound.
"""

from __future__ import annotations

import pytest
import z3

from coordinator.scenario.margin import (
    ARC_ERROR,
    LEAST_MARGIN,
    LEAST_TRACK_MM,
    RESOLUTION,
    SAME,
    TOLERANCE,
    MarginShares,
    between_robots,
)
from tests.solver.proving import is_proven, without

BOUNDS = {
    "tolerance": TOLERANCE,
    "resolution": RESOLUTION,
    "same_i": SAME,
    "same_j": SAME,
    "arcs_i": ARC_ERROR,
    "arcs_j": ARC_ERROR,
}
"""The shares whose bounds are constants [m]: of the proof, and of each robot of a pair."""


def a_pair():
    """Return the premises of two robots at any moment, and the claim that they do not touch."""
    radii, margin = z3.Reals("r_i r_j"), z3.Real("margin")
    tracks, computed = z3.Reals("track_i track_j"), z3.Real("computed")
    takes = {name: z3.Real(name) for name in (*BOUNDS, "off_i", "off_j")}
    need, limits = z3.Sum(*radii) + margin, {name: z3.RealVal(b) for name, b in BOUNDS.items()}
    limits |= {"off_i": tracks[0], "off_j": tracks[1]}
    shares = z3.Sum(*(z3.RealVal(bound) for bound in BOUNDS.values()), *tracks)
    premises = {
        name: z3.And(take <= limits[name], take >= -limits[name]) for name, take in takes.items()
    }
    premises |= {
        "tracks": z3.And(*(one >= 0 for one in tracks)),
        "radii": z3.And(*(one > 0 for one in radii)),
        "shares": shares <= margin,
        "accepted": computed >= need - TOLERANCE,
    }
    premises["tolerance"] = z3.BoolVal(True)  # It stands in `accepted`.
    del takes["tolerance"]
    apart = computed - z3.Sum(*takes.values())
    return premises, apart >= z3.Sum(*radii)


def test_robots_that_use_up_every_share_do_not_touch():
    premises, claim = a_pair()
    assert is_proven(premises, claim)


@pytest.mark.parametrize("left_out", [*(n for n in BOUNDS if n != "tolerance"), "off_i", "shares"])
def test_without_the_bound_of_a_share_they_may(left_out):
    premises, claim = a_pair()
    assert not is_proven(without(premises, left_out), claim)


def test_the_code_adds_up_every_share_of_the_pair():
    tracks = 0.001 * LEAST_TRACK_MM * 2
    assert between_robots(LEAST_TRACK_MM, LEAST_TRACK_MM).total == pytest.approx(
        sum(BOUNDS.values()) + tracks, abs=1e-12
    )
    assert pytest.approx(0.00595, abs=1e-12) == LEAST_MARGIN


def test_a_sum_that_counts_a_change_of_course_once_is_refuted():
    premises, claim = a_pair()
    margin, tracks = z3.Real("margin"), z3.Reals("track_i track_j")
    once = MarginShares(TOLERANCE + RESOLUTION + SAME, 2.0 * ARC_ERROR, 0.0).total
    short = {**premises, "shares": z3.RealVal(once) + z3.Sum(*tracks) <= margin}
    assert not is_proven(short, claim)
