"""The `path` table of a robot in a scenario file: a curve that the robot is to drive.

Decides: which keys a path may have and the default of each key that is absent.  Must not know:
what makes a curve valid (plan/path_parts.py), floors and limits (paths/given_path.py).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final, cast

from coordinator.plan.path_parts import given_faults
from coordinator.scenario.checks import Quantity, show
from coordinator.scenario.model import GivenPath, Point
from coordinator.scenario_files.table_reader import Table

PATH_REQUIRED: Final = ("degree", "control_points")
ROUNDING: Final = {"rounding": Quantity("m", from_least=True, most=1.0)}

_ANY: Final = Quantity(least=-math.inf, most=math.inf)
_NOWHERE: Final = (math.nan, math.nan)
_NOTHING: Final = GivenPath(degree=1, control_points=())
_ENDS: Final = ("start", "goal", "via")


def read_path(robot: Table) -> tuple[GivenPath, Point, Point]:
    """Return a robot's path, start and goal; if problems were noted, an empty path and NaN."""
    for key in _ENDS:
        if key in robot.values:
            robot.note(key, "is given as well as path, which fixes the whole way; give only one")
    before = len(robot.problems)
    path = _path(robot.values["path"], robot.field("path"), robot.problems)
    if len(robot.problems) > before:
        return _NOTHING, _NOWHERE, _NOWHERE
    return path, path.control_points[0], path.control_points[-1]


def _path(value: object, where: str, problems: list[str]) -> GivenPath:
    table = Table(value, where, GivenPath.__struct_fields__, PATH_REQUIRED, problems)
    degree, points = table.values.get("degree"), table.values.get("control_points")
    if type(degree) is not int and "degree" in table.values:
        table.note("degree", f"{show(degree)} is not a whole number")
    path = GivenPath(
        degree=degree if type(degree) is int else 1,
        # An invalid point is told once; the others are checked, and how many there are.
        control_points=tuple(
            point if math.isfinite(point[0]) else (0.0, 0.0)
            for point in table.points("control_points")
        ),
        knots=_numbers(table, "knots"),
        weights=_numbers(table, "weights"),
        **cast(Mapping[str, float], table.numbers(ROUNDING)),
    )
    if type(degree) is int and isinstance(points, list):
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
