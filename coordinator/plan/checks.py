"""Checks of a plan document's values: ranges, knots, speeds, stops, and the floor's outlines.

Decides: which documents are accepted, and the wording of each problem.  Must not know: files
(document.py), or whether a plan is safe (proof/tau_safety.py).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from protocol.keys import NAME, NAME_IN_WORDS
from protocol.messages import MAX_MESSAGE_BYTES

if TYPE_CHECKING:
    from coordinator.plan.document import Floor, Limits, Path, PlanDocument, RobotPlan, Stop
    from coordinator.scenario.model import Point

LONGEST_TAU: Final = 120.0
LONGEST_PLAN: Final = 20_000.0
"""Longest tau and plan [s] that fit into a message and into the memory of the proof."""

LENGTH_TOLERANCE: Final = 1e-3
"""By how much [m] two lengths that should be equal may differ."""

_LARGEST: Final = 1e5
_DEGREES: Final = range(1, 8)


class Range(NamedTuple):
    """Allowed range of one number: `least` to `most`, without `least` itself if `above`."""

    unit: str
    least: float
    most: float = math.inf
    above: bool = False

    def faults(self, field: str, value: float) -> Iterator[str]:
        """Yield a line that names the field if its value is out of range."""
        over = value > self.least if self.above else value >= self.least
        if math.isfinite(value) and over and value <= self.most:
            return
        unit = f" {self.unit}" if self.unit else ""
        bounded = self.most < math.inf
        low = "above" if self.above else "from" if bounded else "at least"
        high = f" to {self.most:.10g}" if bounded else ""
        yield f"{field}: is {value:g}{unit}, must be {low} {self.least:.10g}{high}{unit}"


class PathNames(NamedTuple):
    """The keys by which a file names the parts of a curve."""

    knots: str = "knots"
    points: str = "control_points"
    weights: str = "weights"


PATH_NAMES: Final = PathNames()
_COORDINATE: Final = Range("m", -_LARGEST, _LARGEST)
_POINT: Final = Range("m", -10.0 * _LARGEST, 10.0 * _LARGEST)
"""Range of control points; they may lie outside the floor that the curve stays on."""

_WEIGHT: Final = Range("", 0.0, 1e30, above=True)
_TIME: Final = Range("s", 0.0)
_LENGTH: Final = Range("m", 0.0, above=True)
_SPEED: Final = Range("m/s", 0.0, 999.0)
_COUNTER: Final = 2**32 - 1
_DOCUMENT: Final = {
    "tau": Range("s", 0.0, LONGEST_TAU),
    "margin": Range("m", 0.0, _LARGEST),
    "epoch": Range("", 1, _COUNTER),
}
_LINK: Final = {
    "delay": Range("s", 0.0, 5.0),
    "loss": Range("", 0.0, 0.5),
}
_SMALLEST: Final = 1e-3
"""Least radius [m]: the proof accepts a shortfall of distance up to this size."""

_ROBOT: Final = {
    "radius": Range("m", _SMALLEST, _LARGEST),
    "start_time": Range("s", 0.0, LONGEST_PLAN),
    "finish_time": _TIME,
    "length": _LENGTH,
    "wire_bytes": Range("", 0, MAX_MESSAGE_BYTES),
}
_LIMITS: Final = {
    "max_speed": Range("m/s", 0.0, above=True),
    "max_accel": Range("m/s^2", 1e-3),
    "max_lateral_accel": Range("m/s^2", 0.0, above=True),
    "min_turn_radius": Range("m", 0.0),
    "max_turn_rate": Range("rad/s", 0.0, above=True),
}


def find_problems(document: PlanDocument) -> list[str]:
    """Return a line for each problem of a document: the field, its value and what is allowed."""
    fields = {key: getattr(document, key) for key in (*_DOCUMENT, "link")}
    return parts_problems(fields, document.robots, document.workspace)


def parts_problems(
    fields: Mapping[str, Any], robots: Sequence[RobotPlan | None], floor: Floor | None
) -> list[str]:
    """Return the problems of the parts of a document; a part may be left out, a robot be None."""
    problems: list[str] = []
    for key in [key for key in _DOCUMENT if key in fields]:
        problems += _DOCUMENT[key].faults(key, fields[key])
    for key, allowed in _LINK.items() if "link" in fields else ():
        problems += allowed.faults(f"link.{key}", getattr(fields["link"], key))
    if not robots:
        problems.append("robots: is empty, must contain at least one robot")
    seen: set[str] = set()
    for index, robot in enumerate(robots):
        if robot is None:
            continue
        named = NAME.fullmatch(robot.id) and robot.id not in seen
        where = f"robots[{robot.id if named else index}]"
        if not NAME.fullmatch(robot.id):
            shown = repr(robot.id[:40])
            problems.append(f"{where}.id: is {shown}, must be {NAME_IN_WORDS}")
        elif robot.id in seen:
            problems.append(f"{where}.id: {robot.id!r} is used twice, must be unique")
        seen.add(robot.id)
        problems += _robot_faults(where, robot)
    if floor is not None:
        problems += _floor_faults(floor)
    return problems


def _robot_faults(where: str, robot: RobotPlan) -> Iterator[str]:
    for key, allowed in _ROBOT.items():
        yield from allowed.faults(f"{where}.{key}", getattr(robot, key))
    if robot.limits is not None:
        yield from _limit_faults(f"{where}.limits", robot.limits)
    yield from path_faults(f"{where}.path", robot.path)
    yield from _profile_faults(f"{where}.profile", robot.profile, robot.length)
    yield from _stop_faults(f"{where}.stops", robot.stops, robot.length)


def _limit_faults(where: str, limits: Limits) -> Iterator[str]:
    for key, allowed in _LIMITS.items():
        value = getattr(limits, key)
        if value is not None:
            yield from allowed.faults(f"{where}.{key}", value)


def path_faults(where: str, path: Path, names: PathNames = PATH_NAMES) -> Iterator[str]:
    """Yield what is wrong with a curve's degree, control points, knots and weights.

    `names`: the keys by which the file names them.
    """
    for i, point in enumerate(path.control_points):
        for axis, value in enumerate(point):
            yield from _POINT.faults(f"{where}.{names.points}[{i}][{axis}]", value)
    for i, weight in enumerate(path.weights):
        yield from _WEIGHT.faults(f"{where}.{names.weights}[{i}]", weight)
    count = len(path.control_points)
    if len(path.weights) != count:
        yield (
            f"{where}.{names.weights}: has {len(path.weights)}, "
            f"must have one for each of {count} control points"
        )
    if path.degree not in _DEGREES:
        yield f"{where}.degree: is {path.degree}, must be 1 to 7"
        return
    if count <= path.degree:
        least = path.degree + 1
        yield f"{where}.{names.points}: has {count}, degree {path.degree} needs {least} or more"
        if not path.knots:
            return
    if len(path.knots) != count + path.degree + 1:
        yield (
            f"{where}.{names.knots}: has {len(path.knots)}, "
            f"must have control points + degree + 1 = {count + path.degree + 1}"
        )
    else:
        yield from _knot_faults(f"{where}.{names.knots}", path.knots, path.degree)


def _knot_faults(where: str, knots: Sequence[float], degree: int) -> Iterator[str]:
    first, inner, last = knots[: degree + 1], knots[degree + 1 : -degree - 1], knots[-degree - 1 :]
    if not all(math.isfinite(knot) for knot in knots):
        yield f"{where}: not all are finite, must be finite numbers"
        return
    for i, (before, after) in enumerate(pairwise(knots), start=1):
        if after < before:
            yield f"{where}[{i}]: is {after:g} after {before:g}, must not decrease"
            return
    if any(knot != 0.0 for knot in first):
        yield f"{where}: the first {degree + 1} are {first[0]:g} to {first[-1]:g}, must all be 0"
    if any(knot != last[-1] for knot in last):
        yield f"{where}: the last {degree + 1} are {last[0]:g} to {last[-1]:g}, must be equal"
    if first[0] == last[-1]:
        yield f"{where}: are all the same, must end above where they begin"
        return
    for knot in sorted(set(inner)):
        allowed = 0 if knot in (first[-1], last[0]) else degree
        if inner.count(knot) > allowed:
            times = inner.count(knot)
            yield f"{where}: {knot:g} is {times} times an inner knot, may be {allowed} times"


def _profile_faults(
    where: str, profile: Sequence[tuple[float, float]], length: float
) -> Iterator[str]:
    for i, (s, v) in enumerate(profile):
        yield from _TIME._replace(unit="m").faults(f"{where}[{i}][0]", s)
        yield from _SPEED.faults(f"{where}[{i}][1]", v)
    if len(profile) < 2:
        yield f"{where}: has {len(profile)} speed knots, must have 2 or more"
        return
    for i, ((before, _), (after, _)) in enumerate(pairwise(profile), start=1):
        if not after > before:
            yield f"{where}[{i}][0]: is {after:g} m after {before:g} m, must increase"
            break
    if profile[0][0] != 0.0:
        yield f"{where}[0][0]: is {profile[0][0]:g} m, must be 0 m"
    if not abs(profile[-1][0] - length) <= LENGTH_TOLERANCE:
        yield f"{where}: ends at {profile[-1][0]:g} m, must end at the length, {length:g} m"


def _stop_faults(where: str, stops: Sequence[Stop], length: float) -> Iterator[str]:
    before = 0.0
    for i, stop in enumerate(stops):
        if not before < stop.s < length:
            yield (
                f"{where}[{i}].s: is {stop.s:g} m, "
                f"must be above {before:g} m and below the length, {length:g} m"
            )
        before = stop.s
        yield from _TIME.faults(f"{where}[{i}].arrive", stop.arrive)
        latest = Range("s", max(stop.arrive, 0.0), LONGEST_PLAN)
        yield from latest.faults(f"{where}[{i}].depart", stop.depart)


def _floor_faults(floor: Floor) -> Iterator[str]:
    yield from _polygon_faults("workspace.boundary", floor.boundary)
    for index, corners in enumerate(floor.obstacles):
        yield from _polygon_faults(f"workspace.obstacles[{index}]", corners)


def _polygon_faults(where: str, corners: Sequence[Point]) -> Iterator[str]:
    faults = [
        fault
        for i, corner in enumerate(corners)
        for axis, value in enumerate(corner)
        for fault in _COORDINATE.faults(f"{where}[{i}][{axis}]", value)
    ]
    yield from faults
    if len(corners) < 3:
        yield f"{where}: has {len(corners)} corners, must have 3 or more"
    elif not faults:
        from shapely import Polygon, is_valid_reason

        polygon = Polygon(corners)
        if not polygon.is_valid:
            reason = is_valid_reason(polygon)
            yield f"{where}: {reason}, must not cross or touch itself"
