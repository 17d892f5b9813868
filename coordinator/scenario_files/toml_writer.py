"""A Scenario as TOML for people to read and change; `parse_scenario` reads an equal one back.

Decides: the order of the keys, and the form of numbers and polygons.  Values equal to the
default of a scenario file are omitted, except those of the top table; notes about a map become
comments.  Must not know: files, or whether the scenario is valid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Final

from coordinator.scenario.model import (
    Demand,
    GivenPath,
    Link,
    Order,
    Point,
    Robot,
    Scenario,
    Workspace,
    usual_turn_rate,
)
from coordinator.scenario_files.orders_table import stated

WIDTH: Final = 100
"""A list longer than this many characters gets one line per item."""


def scenario_to_toml(scenario: Scenario, comment: str = "") -> bytes:
    """Return the scenario as TOML text in UTF-8, preceded by the lines of a comment.

    No float loses a bit: each is written as the shortest decimal that reads back as the same float.
    """
    lines = [*_comment(comment), *_top(scenario)]
    if scenario.link != Link():
        lines += ["", "[link]", f"delay = {_number(scenario.link.delay)}"]
        lines += [f"loss = {_number(scenario.link.loss)}"]
    lines += ["", "[workspace]", *_workspace(scenario.workspace)]
    for robot in scenario.robots:
        lines += ["", "[[robots]]", *_robot(robot)]
    for order in scenario.orders:
        lines += ["", "[[orders]]", *_stated(order)]
    if scenario.demand is not None:
        lines += ["", "[demand]", *_stated(scenario.demand)]
    return ("\n".join(lines) + "\n").encode()


def _comment(text: str) -> Iterator[str]:
    return (f"# {line}".rstrip() for line in text.splitlines())


def _top(scenario: Scenario) -> Iterator[str]:
    yield f'name = "{scenario.name}"'
    yield f"tau = {_number(scenario.tau)}"
    yield f"margin = {_number(scenario.margin)}"
    yield f'policy = "{scenario.policy}"'
    yield f"stop_time = {_number(scenario.stop_time)}"
    yield f"speed_reserve = {_number(scenario.speed_reserve)}"


def _workspace(floor: Workspace) -> Iterator[str]:
    for note in floor.notes:
        yield from _comment(note)
    (x0, y0), (x1, y1) = floor.boundary[0], floor.boundary[2]
    if floor.boundary == ((x0, y0), (x1, y0), (x1, y1), (x0, y1)) and x0 < x1 and y0 < y1:
        yield f"bounds = {_place((x0, y0, x1, y1))}"
    else:
        yield from _listed("boundary", (_place(corner) for corner in floor.boundary))
    if floor.obstacles:
        yield "obstacles = ["
        for corners in floor.obstacles:
            yield f"  {_places(corners)},"
        yield "]"


def _robot(robot: Robot) -> Iterator[str]:
    yield f'id = "{robot.id}"'
    if robot.path is None:
        yield f"start = {_place(robot.start)}"
        if robot.goal != robot.start or robot.via:
            yield f"goal = {_place(robot.goal)}"
    if robot.via:
        yield from _listed("via", (_place(via) for via in robot.via))
    yield f"radius = {_number(robot.radius)}"
    yield f"max_speed = {_number(robot.max_speed)}"
    if robot.max_accel != robot.max_speed:
        yield f"max_accel = {_number(robot.max_accel)}"
    if robot.max_lateral_accel != robot.max_accel:
        yield f"max_lateral_accel = {_number(robot.max_lateral_accel)}"
    if robot.min_turn_radius:
        yield f"min_turn_radius = {_number(robot.min_turn_radius)}"
    if robot.max_turn_rate != usual_turn_rate(robot.max_accel):
        yield f"max_turn_rate = {_number(robot.max_turn_rate)}"
    if robot.home is not None:
        yield f"home = {_place(robot.home)}"
    if robot.priority:
        yield f"priority = {robot.priority}"
    if robot.path is not None:
        yield from _path(robot.path)


def _stated(table: Order | Demand) -> Iterator[str]:
    for key, value in stated(table).items():
        if key in ("via", "places"):
            yield from _listed(key, (_place(place) for place in value))
        elif key == "goal":
            yield f"goal = {_place(value)}"
        elif key in ("per_robot", "priority", "seed"):
            yield f"{key} = {value}"
        else:
            yield f"{key} = {_number(value)}"


def _path(path: GivenPath) -> Iterator[str]:
    yield f"path.degree = {path.degree}"
    yield from _listed("path.control_points", (_place(point) for point in path.control_points))
    if path.knots:
        yield from _listed("path.knots", (_number(knot) for knot in path.knots))
    if path.weights:
        yield from _listed("path.weights", (_number(weight) for weight in path.weights))
    if path.rounding:
        yield f"path.rounding = {_number(path.rounding)}"


def _listed(key: str, items: Iterable[str]) -> Iterator[str]:
    """Yield a list on one line if it is short, otherwise with one item per line."""
    texts = list(items)
    line = f"{key} = [{', '.join(texts)}]"
    if len(line) <= WIDTH:
        yield line
    else:
        yield f"{key} = ["
        yield from (f"  {text}," for text in texts)
        yield "]"


def _places(places: Iterable[Point]) -> str:
    return f"[{', '.join(_place(place) for place in places)}]"


def _place(numbers: Sequence[float]) -> str:
    return f"[{', '.join(_number(number) for number in numbers)}]"


def _number(value: float | str) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return "inf" if math.isinf(value) else repr(float(value))
