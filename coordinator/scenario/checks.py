"""Checks of a scenario's values: the range of every number, and where robots may stand.

Decides: ranges, which polygons are valid, which places of robots are checked and for what, and the
wording of each fault.  Must not know: files and their syntax (scenario_files/scenario_reader.py).
NaN, an empty name and an empty polygon replace values that were already reported as invalid; they
are not reported again.
"""

from __future__ import annotations

import itertools
import math
import re
import sys
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
import shapely

from coordinator.scenario.id_checks import doubled_ids
from coordinator.scenario.margin import LEAST_MARGIN, LEAST_TRACK_MM, between_robots
from coordinator.scenario.model import Point, Pose, Robot, Scenario, Workspace
from coordinator.scenario.obstacle_names import polygons_of
from coordinator.scenario.order_checks import order_problems, order_spots
from coordinator.scenario.place_checks import (
    BOUNDARY,
    MOST_PAIRS,
    Spot,
    missing_steps,
    near_pairs,
    shape_name,
    tight_places,
)
from protocol import messages
from protocol.keys import NAME

LARGEST: Final = 100_000.0
"""No size [m] and no other quantity may exceed this."""
FARTHEST: Final = messages.FARTHEST
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
LEAST: Final = 1e-3
"""No radius [m], speed [m/s or rad/s] or acceleration [m/s^2] is smaller: plans would last for
days."""


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
        return f"{shown} is too large" if abs(value) > sys.float_info.max else None


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
    "max_turn_rate": Quantity("rad/s", least=LEAST, from_least=True, word="inf"),
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
    polygons, faults = _outlines(floor)
    sound = {index: polygon for index, polygon in polygons.items() if index not in faults}
    problems = [
        f"{shape_name(floor, polygons, i, polygons[i])}: {fault}" for i, fault in faults.items()
    ]
    problems += doubled_ids("robots", [robot.id for robot in scenario.robots])
    for index, robot in enumerate(scenario.robots):
        if robot.path is None:
            problems += missing_steps(f"robots[{index}]", _places(f"robots[{index}]", robot))
        problems += _turn_at_start(f"robots[{index}]", robot)
    problems += order_problems(scenario)
    # GEOS divides by the length of edges near 1e-300 m, which numpy would report as a warning.
    with np.errstate(all="ignore"):
        problems += tight_places(list(_spots(scenario)), floor, sound)
        for which in ("start", "goal"):
            problems += _overlaps(scenario, which)
    return problems


def is_sound(floor: Workspace) -> bool:
    """Return whether the floor has an outline, and this and all obstacles are valid."""
    polygons, faults = _outlines(floor)
    return not faults and BOUNDARY in polygons and len(polygons) == len(floor.obstacles) + 1


def _outlines(floor: Workspace) -> tuple[dict[int, shapely.Polygon], dict[int, str | None]]:
    """Return the outlines of the floor and its obstacles, and what is wrong with the invalid ones.

    Both are by index; empty ones are left out.
    """
    rings = {BOUNDARY: floor.boundary} if floor.boundary else {}
    rings |= {index: ring for index, ring in enumerate(floor.obstacles) if ring}
    shapes = polygons_of(list(rings.values()))
    polygons: dict[int, shapely.Polygon] = dict(zip(rings, shapes.tolist(), strict=True))
    flat = shapely.area(shapely.convex_hull(shapes)) <= LEAST_AREA
    doubtful = np.array(list(rings), np.intp)[flat | ~shapely.is_valid(shapes)].tolist()
    return polygons, {index: ring_fault(polygons[index]) for index in doubtful}


def corners_fault(corners: Sequence[Point]) -> str | None:
    """Return why no polygon has these corners [m]; None if one has."""
    if len(corners) < 3:
        return f"{len(corners)} corners, a polygon has three or more"
    return ring_fault(shapely.Polygon(corners))


def ring_fault(polygon: shapely.Polygon) -> str | None:
    """Return why a polygon's outline is invalid, and where; None if it is valid."""
    if shapely.convex_hull(polygon).area <= LEAST_AREA:
        return "its corners lie on one line, a polygon needs an area"
    if polygon.is_valid:
        return None
    place = re.search(r"\[(\S+) (\S+)\]", shapely.is_valid_reason(polygon))
    where = f" at ({float(place[1]):g}, {float(place[2]):g}) m" if place else ""
    return f"its outline crosses or touches itself{where}"


def _places(field: str, robot: Robot) -> list[tuple[str, Point | Pose]]:
    """Return (field, place) of the start, every via point and the goal, in the order of driving."""
    first, last = robot.end_fields
    if robot.is_idle:
        return [(f"{field}.{first}", robot.start)]
    vias = [(f"{field}.via[{index}]", via) for index, via in enumerate(robot.via)]
    return [(f"{field}.{first}", robot.start), *vias, (f"{field}.{last}", robot.goal)]


def _turn_at_start(field: str, robot: Robot) -> Iterator[str]:
    if robot.is_idle and len(robot.start) == len(robot.goal) == 3 and robot.start != robot.goal:
        yield f"{field}.goal: has another heading than start, and a robot does not turn at rest"


def _spots(scenario: Scenario) -> Iterator[Spot]:
    """Yield the places where robots must have room, of orders and demand too."""
    for index, robot in enumerate(scenario.robots):
        places = _places(f"robots[{index}]", robot)
        if robot.home is not None:
            places.append((f"robots[{index}].home", robot.home))
        for field, place in places:
            yield Spot(field, place[0], place[1], robot.radius + scenario.margin)
    yield from order_spots(scenario)


def _overlaps(scenario: Scenario, which: str) -> Iterator[str]:
    """Yield a message for each pair of robots whose starts (or goals) are too near together.

    The goals of two idle robots are their starts, which are checked as such.
    """
    robots = scenario.robots
    places = np.array([getattr(robot, which)[:2] for robot in robots]).reshape(-1, 2)
    radii = np.array([robot.radius for robot in robots])
    pairs = (
        pair
        for pair in near_pairs(places, radii, scenario.margin)
        if which == "start" or not (robots[pair[0]].is_idle and robots[pair[1]].is_idle)
    )
    for first, second, gap in itertools.islice(pairs, MOST_PAIRS):
        yield _overlap(scenario, which, first, second, gap)
    if next(pairs, None) is not None:
        yield f"robots: over {MOST_PAIRS} pairs of {which}s overlap, the rest is not listed"


def _overlap(scenario: Scenario, which: str, first: int, second: int, gap: float) -> str:
    a, b = scenario.robots[first], scenario.robots[second]
    name_a, name_b = a.id or f"robots[{first}]", b.id or f"robots[{second}]"
    field = b.end_fields[which == "goal"]
    return (
        f"robots[{second}].{field}: {name_b} is {gap:.6g} m from the {which} of {name_a}, "
        f"their radii + margin need {scenario.need(a, b):.6g} m"
    )
