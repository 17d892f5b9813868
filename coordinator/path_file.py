"""The `path` of a scenario's robot: a curve that was given, from a file's table.

Decides: which parts a path may have, what stands for one that is absent, and what is wrong with
one.  Must not know: floors, limits (given_path.py), other keys of a robot (scenario_file.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, cast

from coordinator.plan import Path
from coordinator.plan_checks import PATH_NAMES, PathNames, path_faults
from coordinator.scenario import GivenPath, Point
from coordinator.scenario_checks import Quantity, show
from coordinator.scenario_table import Table, read_place

PATH_REQUIRED: Final = ("degree", "control_points")
ROUNDING: Final = {"rounding": Quantity("m", from_least=True, most=1.0)}
MOST_POINTS: Final = 5_000
"""Control points of a path: more than ten times as many as a Plan can hold, found out soon."""

MOST_WEIGHT: Final = 100.0
"""By so many times weights may differ: the wire's limit."""

_ANY: Final = Quantity(least=-math.inf, most=math.inf)
_NOWHERE: Final = (math.nan, math.nan)
_NOTHING: Final = GivenPath(degree=1, control_points=())
_ENDS: Final = ("start", "goal", "via")


def read_path(robot: Table) -> tuple[GivenPath, Point, Point]:
    """Return a robot's path, its start and its goal; NaN when problems were noted."""
    for key in _ENDS:
        if key in robot.values:
            robot.note(key, "stands beside path, which says where the robot drives; give only one")
    before = len(robot.problems)
    path = _path(robot.values["path"], robot.field("path"), robot.problems)
    if len(robot.problems) > before:
        return _NOTHING, _NOWHERE, _NOWHERE
    return path, path.control_points[0], path.control_points[-1]


def whole(path: GivenPath) -> Path:
    """Return a path with all its parts; the knots begin at 0."""
    count, degree = len(path.control_points), path.degree
    knots = path.knots or uniform_knots(degree, count)
    return Path(
        degree=degree,
        knots=[knot - knots[0] for knot in knots],
        control_points=list(path.control_points),
        weights=list(path.weights or (1.0,) * count),
    )


def uniform_knots(degree: int, count: int) -> tuple[float, ...]:
    """Return the clamped knots from 0 to 1 of evenly wide spans; none where there is no span."""
    spans = count - degree
    if degree < 1 or spans < 1:
        return ()
    inner = (k / spans for k in range(1, spans))
    return (0.0,) * (degree + 1) + tuple(inner) + (1.0,) * (degree + 1)


def too_many(count: int) -> str:
    """Return how to say that a path has more control points than MOST_POINTS."""
    return f"{count:,}, allowed are up to {MOST_POINTS:,}"


def given_faults(path: GivenPath, where: str, names: PathNames = PATH_NAMES) -> list[str]:
    """Return what is wrong with a path's parts, as `field: what` each."""
    count = len(path.control_points)
    if count > MOST_POINTS:
        return [f"{where}.{names.points}: are {too_many(count)}"]
    problems = list(path_faults(where, whole(path), names))
    low, high = min(path.weights, default=1.0), max(path.weights, default=1.0)
    if not problems and high > MOST_WEIGHT * low:
        many = f"{high / low:g}" if high < 1e6 * low else "over a million"
        problems.append(
            f"{where}.{names.weights}: differ by {many} times, allowed is up to {MOST_WEIGHT:g}"
        )
    return problems


def _path(value: object, where: str, problems: list[str]) -> GivenPath:
    table = Table(value, where, GivenPath.__struct_fields__, PATH_REQUIRED, problems)
    before = len(problems)
    degree = table.values.get("degree")
    if type(degree) is not int and "degree" in table.values:
        table.note("degree", f"{show(degree)} is not a whole number")
    points = [
        cast(Point, read_place(point, f"{where}.control_points[{i}]", (2,), problems))
        for i, point in enumerate(table.items("control_points", "places [[x, y], ...]"))
    ]
    path = GivenPath(
        degree=degree if type(degree) is int else 1,
        control_points=tuple(points),
        knots=_numbers(table, "knots"),
        weights=_numbers(table, "weights"),
        **cast(Mapping[str, float], table.numbers(ROUNDING)),
    )
    if table.values.keys() >= set(PATH_REQUIRED) and len(problems) == before:
        problems += given_faults(path, where)
    return path


def _numbers(table: Table, key: str) -> tuple[float, ...]:
    numbers = table.items(key, "numbers")
    for i, number in enumerate(numbers):
        complaint = _ANY.complaint(number)
        if complaint:
            table.problems.append(f"{table.field(key)}[{i}]: {complaint}")
            return ()
    return tuple(float(cast(float, number)) for number in numbers)
