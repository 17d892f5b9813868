"""The proof that staircases cover every conflict of a plan, from the decoded wire bytes alone.

A fleet keeps clear at any delay if, whenever one robot is at plan time t, every other one has
passed the need of their staircase at t (design section 3).  So no conflict may lie above a
staircase.  Conflicts within tau of each other are left to the proof of tau-safety, which shows that
there are none.

Decides: whether staircases may be used to grant authority.  Must not know: zones and schedules,
which staircases are made from.
"""

from __future__ import annotations

from concurrent.futures import Executor
from itertools import pairwise
from typing import Final

import numpy as np

from coordinator.plan.staircases import Staircases
from coordinator.proof.motion_pieces import Flights
from coordinator.proof.precedence_kernels import Needs, Uncovered, uncovered
from coordinator.proof.separation_kernels import Motions
from coordinator.scenario.margin import RESOLUTION, TOLERANCE

_DEVIATION: Final = 2.5e-4
"""Greatest deviation [m] of the pieces that are compared."""

_MOST_SAID: Final = 20

_MANY: Final = 100
_PARTS: Final = 12
"""From _MANY robots on, an executor gets the work in so many parts."""


def staircase_failures(
    flights: Flights, staircases: Staircases, margin: float, executor: Executor | None = None
) -> list[str]:
    """Return a sentence for each ordered pair with a conflict above its staircase; margin [m].

    The executor gets parts of the work of large fleets; the answer does not depend on it.  A
    shortfall of the distance below margin.TOLERANCE is accepted, as by the proof of tau-safety.
    """
    driven = flights.driven
    if len(driven) < 2:
        return []
    pieces = flights.pieces(_DEVIATION)
    count = len(driven)
    first = np.searchsorted(pieces.robot, np.arange(count + 1))
    keep = np.array([one.radius for one in driven]) + 0.5 * margin
    enough = keep - 0.5 * (TOLERANCE + RESOLUTION)
    motions = Motions(pieces.rows, first, enough, flights.asked)
    needs = needs_of(staircases, count)
    tau = staircases.tau_ms / 1000.0
    if executor is None or count < _MANY:
        found = uncovered(motions, needs, tau, 0, count)
    else:
        shares = pairwise(_borders(count))
        waiting = [executor.submit(_uncovered_by, motions, needs, tau, *one) for one in shares]
        found = [one for future in waiting for one in future.result()]
    failing = sorted(found, key=lambda one: (one.behind, one.ahead))
    said = [
        f"{driven[one.behind].id} at {one.t_behind:.2f} s is too near {driven[one.ahead].id} at "
        f"{one.t_ahead:.2f} s, which its staircase does not say"
        for one in failing[:_MOST_SAID]
    ]
    more = len(failing) - len(said)
    return [*said, f"and {more} more pairs"] if more > 0 else said


def needs_of(staircases: Staircases, count: int) -> Needs:
    """Return the staircases of so many robots as the kernels look them up."""
    turned = np.argsort(staircases.ahead, kind="stable")
    robots = np.arange(count + 1)
    return Needs(
        np.searchsorted(staircases.behind, robots),
        staircases.behind,
        staircases.ahead,
        np.searchsorted(staircases.ahead[turned], robots),
        turned,
        staircases.first,
        staircases.at,
        staircases.need,
    )


def _uncovered_by(
    motions: Motions, needs: Needs, tau: float, begin: int, end: int
) -> list[Uncovered]:
    """Do what `uncovered` does; an executor's process can call this function."""
    return list(uncovered(motions, needs, tau, begin, end))


def _borders(count: int) -> list[int]:
    """Return where parts of the robots begin and end that have equally many pairs with later ones.

    Robot a has count - a - 1 of them.
    """
    left = np.sqrt(np.linspace(1.0, 0.0, _PARTS + 1))
    borders: list[int] = np.round(count * (1.0 - left)).astype(int).tolist()
    return borders
