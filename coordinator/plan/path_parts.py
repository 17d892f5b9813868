"""The parts of a given path (degree, knots, control points, weights): defaults and checks.

Decides: the default of a part that is absent, and which values of a part are wrong.  Must not know:
files, floors, limits (paths/given_path.py).
"""

from __future__ import annotations

from typing import Final

from coordinator.plan.checks import PATH_NAMES, PathNames, path_faults
from coordinator.plan.document import Path
from coordinator.scenario.model import GivenPath

MOST_POINTS: Final = 5_000
"""The greatest number of control points of a path, over ten times what a Plan can hold: a path with
more is refused before anything is computed from it."""

MOST_WEIGHT: Final = 100.0
"""Largest allowed ratio of two weights, a limit of the wire."""


def whole(path: GivenPath) -> Path:
    """Return a path with defaults for its absent parts, and its knots shifted to begin at 0."""
    count, degree = len(path.control_points), path.degree
    knots = path.knots or uniform_knots(degree, count)
    return Path(
        degree=degree,
        knots=[knot - knots[0] for knot in knots],
        control_points=list(path.control_points),
        weights=list(path.weights or (1.0,) * count),
    )


def uniform_knots(degree: int, count: int) -> tuple[float, ...]:
    """Return clamped knots from 0 to 1 with spans of equal width; empty if there is no span."""
    spans = count - degree
    if degree < 1 or spans < 1:
        return ()
    inner = (k / spans for k in range(1, spans))
    return (0.0,) * (degree + 1) + tuple(inner) + (1.0,) * (degree + 1)


def too_many(count: int) -> str:
    """Return the words of a problem: a count of control points above MOST_POINTS."""
    return f"{count:,}, must be at most {MOST_POINTS:,}"


def given_faults(path: GivenPath, where: str, names: PathNames = PATH_NAMES) -> list[str]:
    """Return what is wrong with a path's parts, each as `field: what is wrong`."""
    count = len(path.control_points)
    if count > MOST_POINTS:
        return [f"{where}.{names.points}: has {too_many(count)}"]
    problems = list(path_faults(where, whole(path), names))
    low, high = min(path.weights, default=1.0), max(path.weights, default=1.0)
    if not problems and high > MOST_WEIGHT * low:
        many = f"{high / low:g}" if high < 1e6 * low else "over a million"
        problems.append(
            f"{where}.{names.weights}: differ by {many} times, must be at most {MOST_WEIGHT:g}"
        )
    return problems
