"""Checks of a scenario's values: the range of every number, and where robots may stand.

Decides: ranges, which polygons are valid, how much room starts, goals and via points need, and the
wording of each fault.  Must not know: files and their syntax (scenario_files/scenario_reader.py).
NaN, an empty name and an empty polygon replace values that were already reported as invalid; they
are not reported again.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from coordinator.scenario.margin import LEAST_MARGIN, LEAST_TRACK_MM, between_robots
from coordinator.scenario.model import Point, Pose, Robot, Scenario, Workspace
from coordinator.scenario.obstacle_names import obstacle_name, polygons_of
from protocol.keys import NAME

LARGEST: Final = 100_000.0
"""No size [m] and no other quantity may exceed this."""
FARTHEST: Final = 8_000.0
"""No coordinate goes beyond this [m]: a little farther out, float32 resolves only 1 mm."""
TOO_FAR: Final = "where float32 on the wire is coarser than 0.5 mm; move the origin nearer"
"""The reason given for a coordinate beyond FARTHEST."""
TOO_SMALL: Final = (
    f"of which the proof and the robots' tables of arc lengths take "
    f"{1000 * between_robots(0, 0).total:g} mm, and tracking by two robots {LEAST_TRACK_MM} mm each"
)
"""The reason given for a margin below LEAST_MARGIN."""
FASTEST: Final = 999.0
"""Timetables on the wire refuse speeds of 1000 m/s or more (protocol/timeline.py)."""
LEAST_AREA: Final = 1e-9
"""A polygon whose convex hull has no more area [m^2] than this is a line or a point."""
LEAST_STEP: Final = 1e-3
"""Two places nearer than this [m] are the same place: there is no path between them."""
LEAST: Final = 1e-3
"""No radius [m], speed [m/s] or acceleration [m/s^2] is smaller: plans would last for days."""
ROUNDING: Final = 1e-9
"""Distances may be short by this [m], so that rounding does not refuse an exact place."""
MOST_PAIRS: Final = 1_000
"""At most this many overlapping pairs are listed: all robots in one place would give millions."""
PAIR_CHUNK: Final = 256
"""Number of robots whose neighbours are looked up at a time, which bounds the memory if all robots
are in one place."""
BOUNDARY: Final = -1
"""The index of the floor's outline, beside the indices of obstacles."""

Numbers = NDArray[np.float64]
Points = NDArray[np.object_]


class Quantity(NamedTuple):
    """The range of one number: above `least` (or from it on), up to `most` (or below it).

    `word` is a string that is accepted instead; "inf" accepts the infinite number as well.
    Messages give `why` as the reason for a limit, or `why_least` for the lower one.
    """

    unit: str = ""
    least: float = 0.0
    most: float = LARGEST
    from_least: bool = False
    below_most: bool = False
    word: str = ""
    why: str = ""
    why_least: str = ""

    def complaint(self, value: object) -> str | None:
        """Return what is wrong with a value from a file, or None."""
        if self.word and (value == self.word or (self.word == "inf" and value == math.inf)):
            return None
        if isinstance(value, bool) or not isinstance(value, int | float):
            return f"{show(value)} is not a number" + (f' or "{self.word}"' if self.word else "")
        if isinstance(value, float) and not math.isfinite(value):
            return f"{value} is not a finite number"
        shown = f"{show(value)} {self.unit}".rstrip()
        if value < self.least or (value == self.least and not self.from_least):
            limit = f"below {self.least:g} {self.unit}" if self.from_least else "not positive"
            return _joined(f"{shown} is {limit}".rstrip(), self.why_least or self.why)
        if value > self.most or (value == self.most and self.below_most):
            limit = "not below" if self.below_most else "above"
            return _joined(f"{shown} is {limit} {self.most:g} {self.unit}".rstrip(), self.why)
        return None


def _joined(complaint: str, reason: str) -> str:
    return f"{complaint}, {reason}" if reason else complaint


COORDINATE: Final = Quantity("m", -FARTHEST, FARTHEST, from_least=True, why=TOO_FAR)
HEADING: Final = Quantity("rad", least=-LARGEST, from_least=True)
SCENARIO_QUANTITIES: Final = {
    "tau": Quantity("s", from_least=True, most=60.0, word="auto"),
    "margin": Quantity("m", least=LEAST_MARGIN, from_least=True, why_least=TOO_SMALL),
    "stop_time": Quantity("s"),
    "speed_reserve": Quantity(from_least=True, most=1.0, below_most=True),
}
ROBOT_QUANTITIES: Final = {
    "radius": Quantity("m", least=LEAST, from_least=True),
    "max_speed": Quantity("m/s", least=LEAST, most=FASTEST, from_least=True),
    "max_accel": Quantity("m/s^2", least=LEAST, from_least=True, word="inf"),
    "max_lateral_accel": Quantity("m/s^2", least=LEAST, from_least=True, word="inf"),
    "min_turn_radius": Quantity("m", from_least=True),
}


def show(value: object) -> str:
    """Return a value from a file in a form fit for a message: one line, short, printable."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, int) and value.bit_length() > 64:
        return f"about {'-' if value < 0 else ''}1e{math.log10(2.0) * value.bit_length():.0f}"
    text = "null" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def printable(text: str) -> str:
    """Return text as a terminal shows it on one line."""
    return text if text.isprintable() else repr(text)


def key_name(key: str) -> str:
    """Return a key of a file as part of a field's name."""
    return key if NAME.fullmatch(key) else show(key)


def find_problems(scenario: Scenario) -> list[str]:
    """Return all that is wrong with the scenario, each as `field: what is wrong`."""
    floor = scenario.workspace
    rings = {BOUNDARY: floor.boundary} if floor.boundary else {}
    rings |= {index: ring for index, ring in enumerate(floor.obstacles) if ring}
    shapes = polygons_of(list(rings.values()))
    polygons: dict[int, shapely.Polygon] = dict(zip(rings, shapes.tolist(), strict=True))
    flat = shapely.area(shapely.convex_hull(shapes)) <= LEAST_AREA
    doubtful = np.array(list(rings), np.intp)[flat | ~shapely.is_valid(shapes)].tolist()
    faults = {index: ring_fault(polygons[index]) for index in doubtful}
    sound = {index: polygon for index, polygon in polygons.items() if index not in faults}
    problems = [
        f"{_shape_name(floor, polygons, i, polygons[i])}: {fault}" for i, fault in faults.items()
    ]
    problems += _doubled_ids(scenario.robots)
    for index, robot in enumerate(scenario.robots):
        if robot.path is None:
            problems += _missing_steps(f"robots[{index}]", robot)
    # GEOS divides by the length of edges near 1e-300 m, which numpy would report as a warning.
    with np.errstate(all="ignore"):
        problems += _tight_places(scenario, sound)
        for which in ("start", "goal"):
            problems += _overlaps(scenario, which)
    return problems


def _shape_name(
    floor: Workspace, polygons: dict[int, shapely.Polygon], index: int, near: shapely.Geometry
) -> str:
    """Return the name of a polygon; one from a map is named by its place nearest to `near`."""
    if index == BOUNDARY:
        return "workspace.boundary"
    listed = f"workspace.obstacles[{index}]"
    return obstacle_name(listed, index, polygons[index], near, floor.from_map)


def ring_fault(polygon: shapely.Polygon) -> str | None:
    """Return why a polygon's outline is invalid, and where; None if it is valid."""
    if shapely.convex_hull(polygon).area <= LEAST_AREA:
        return "its corners lie on one line, a polygon needs an area"
    if polygon.is_valid:
        return None
    place = re.search(r"\[(\S+) (\S+)\]", shapely.is_valid_reason(polygon))
    where = f" at ({float(place[1]):g}, {float(place[2]):g}) m" if place else ""
    return f"its outline crosses or touches itself{where}"


def _doubled_ids(robots: Sequence[Robot]) -> Iterator[str]:
    first: dict[str, int] = {}
    for index, robot in enumerate(robots):
        if robot.id and first.setdefault(robot.id, index) != index:
            yield f"robots[{index}].id: {robot.id!r} is already the id of robots[{first[robot.id]}]"


def _places(field: str, robot: Robot) -> list[tuple[str, Point | Pose]]:
    """Return (field, place) of the start, every via point and the goal, in the order of driving."""
    first, last = robot.end_fields
    vias = [(f"{field}.via[{index}]", via) for index, via in enumerate(robot.via)]
    return [(f"{field}.{first}", robot.start), *vias, (f"{field}.{last}", robot.goal)]


def _missing_steps(field: str, robot: Robot) -> Iterator[str]:
    places = _places(field, robot)
    for (before_field, before), (after_field, after) in itertools.pairwise(places):
        if math.dist(before[:2], after[:2]) < LEAST_STEP:
            where = f"({after[0]:g}, {after[1]:g}) m"
            before_key = before_field.removeprefix(f"{field}.")
            yield (
                f"{after_field}: {where} is the same place as {before_key}, "
                "so there is nothing to drive between them"
            )


def _tight_places(scenario: Scenario, polygons: dict[int, shapely.Polygon]) -> Iterator[str]:
    """Yield a message for each place off the floor or too near to its edge or an obstacle.

    There are at most two for a place: one for the floor, one for the nearest obstacle.
    """
    spots = [
        _Spot(field, place[0], place[1], robot.radius + scenario.margin)
        for index, robot in enumerate(scenario.robots)
        for field, place in _places(f"robots[{index}]", robot)
        if math.isfinite(place[0])
    ]
    points = shapely.points(np.array([(spot.x, spot.y) for spot in spots]).reshape(-1, 2))
    # A robot of unknown size still must not stand inside an obstacle or off the floor.
    needs = np.nan_to_num(np.array([spot.need for spot in spots]))
    needs = np.maximum(needs - ROUNDING, ROUNDING)
    obstacles = {index: shape for index, shape in polygons.items() if index != BOUNDARY}
    if BOUNDARY in polygons:
        yield from _edge_problems(spots, points, needs, polygons[BOUNDARY])
    if obstacles:
        yield from _obstacle_problems(spots, points, needs, scenario.workspace, obstacles)


class _Spot(NamedTuple):
    """A place where a robot must have room: `need` [m] is its radius + margin, NaN if unknown."""

    field: str
    x: float
    y: float
    need: float

    def problem(self, where: str) -> str:
        need = "" if math.isnan(self.need) else f", radius + margin need {self.need:.6g} m"
        return f"{self.field}: ({self.x:g}, {self.y:g}) m is {where}{need}"


def _edge_problems(
    spots: Sequence[_Spot], points: Points, needs: Numbers, floor: shapely.Polygon
) -> Iterator[str]:
    edge = floor.exterior
    shapely.prepare([floor, edge])
    inside = shapely.covers(floor, points)
    for at in np.flatnonzero(~inside | shapely.dwithin(edge, points, needs)).tolist():
        distance = shapely.distance(edge, points[at])
        side = "from the edge of" if inside[at] else "outside"
        yield spots[at].problem(f"{distance:.6g} m {side} the floor")


def _obstacle_problems(
    spots: Sequence[_Spot],
    points: Points,
    needs: Numbers,
    floor: Workspace,
    obstacles: dict[int, shapely.Polygon],
) -> Iterator[str]:
    indices, shapes = list(obstacles), np.array(list(obstacles.values()))
    at, which = shapely.STRtree(shapes).query(points, predicate="dwithin", distance=needs)
    distance = shapely.distance(points[at], shapes[which])
    nearest_first = np.lexsort((distance, at))
    at, which, distance = at[nearest_first], which[nearest_first], distance[nearest_first]
    for first in np.unique(at, return_index=True)[1]:
        name = _shape_name(floor, obstacles, indices[which[first]], points[at[first]])
        away = f"{distance[first]:.6g} m from" if distance[first] > 0.0 else "inside"
        yield spots[at[first]].problem(f"{away} {name}")


def _overlaps(scenario: Scenario, which: str) -> Iterator[str]:
    """Yield a message for each pair of robots whose starts (or goals) are too near together."""
    robots = scenario.robots
    places = np.array([getattr(robot, which)[:2] for robot in robots]).reshape(-1, 2)
    radii = np.array([robot.radius for robot in robots])
    known = np.flatnonzero(np.isfinite(places[:, 0]) & np.isfinite(radii + scenario.margin))
    # Each robot looks only for robots that are no larger than itself, so twice its radius suffices.
    by_size = known[np.argsort(-radii[known], kind="stable")]
    points = shapely.points(places[by_size])
    tree = shapely.STRtree(points)
    reach = 2.0 * radii[by_size] + scenario.margin
    found = 0
    for begin in range(0, len(by_size), PAIR_CHUNK):
        chunk = slice(begin, begin + PAIR_CHUNK)
        larger, smaller = tree.query(points[chunk], predicate="dwithin", distance=reach[chunk])
        larger += begin
        a, b = by_size[larger], by_size[smaller]
        distance = np.hypot(*(places[a] - places[b]).T)
        near = (larger < smaller) & (distance < radii[a] + radii[b] + scenario.margin - ROUNDING)
        for i, j, gap in zip(a[near], b[near], distance[near], strict=True):
            found += 1
            if found > MOST_PAIRS:
                yield f"robots: over {MOST_PAIRS} pairs of {which}s overlap, the rest is not listed"
                return
            yield _overlap(scenario, which, int(min(i, j)), int(max(i, j)), gap)


def _overlap(scenario: Scenario, which: str, first: int, second: int, gap: float) -> str:
    a, b = scenario.robots[first], scenario.robots[second]
    name_a, name_b = a.id or f"robots[{first}]", b.id or f"robots[{second}]"
    field = b.end_fields[which == "goal"]
    return (
        f"robots[{second}].{field}: {name_b} is {gap:.6g} m from the {which} of {name_a}, "
        f"their radii + margin need {scenario.need(a, b):.6g} m"
    )
