"""MovingAI benchmark scenarios: the cells between which the agents of a .scen file move, as robots.

Decides: which forms of .scen files are read, what a robot is that stands for an agent, and the
wording of each fault.  Must not know: the characters of maps.  Format:
https://movingai.com/benchmarks/formats.html.  Cells count from the top left, y of a floor upwards.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from coordinator.base.errors import InputError
from coordinator.scenario.checks import (
    ROBOT_QUANTITIES,
    SCENARIO_QUANTITIES,
    find_problems,
    printable,
    show,
)
from coordinator.scenario.model import MOST_ROBOTS, Robot, Scenario, Workspace, usual_turn_rate
from coordinator.scenario_files.maps.cells import Grid
from coordinator.scenario_files.maps.floor_map import fail, read_bytes
from coordinator.scenario_files.maps.movingai import (
    MOST_FAULTS,
    floor_map_of,
    read_movingai_grid,
)

_MOST_BYTES: Final = 64_000_000
_FIELDS: Final = ("width", "height", "start x", "start y", "goal x", "goal y")
_WHOLE: Final = re.compile(r"\d{1,9}", re.ASCII)

Cell = tuple[int, int]
"""Column and row, from the top left."""


class Trip(NamedTuple):
    """An agent: the number of its line, the size of the map it is for, and where it moves."""

    line: int
    size: Cell
    start: Cell
    goal: Cell


class Bodies(NamedTuple):
    """The robots that stand for agents: radius [cells], limits, and the scenario's tau, margin [m].

    accel [m/s^2] limits lateral acceleration, too.
    """

    radius: float
    max_speed: float
    max_accel: float
    tau: float | None
    margin: float


def scenario_of(
    map_file: Path, scen_file: Path, robots: int | None, cell: float, bodies: Bodies, name: str
) -> Scenario:
    """Return a scenario with the first `robots` agents (None: all), on cells of `cell` [m].

    Raises InputError with every problem of both files.
    """
    problems = [f"--{name.replace('_', '-')}: {fault}" for name, fault in _unfit(bodies)]
    floor = grid = None
    try:
        grid = read_movingai_grid(map_file, cell)
        floor = floor_map_of(map_file, grid, 0.0)
    except InputError as error:
        problems += error.problems
    trips: list[Trip] = []
    try:
        trips = read_scen(scen_file, grid, robots)
    except InputError as error:
        problems += error.problems
    if floor is None or grid is None or problems:
        raise InputError(problems)
    rows = len(grid.occupied)
    made = Scenario(
        name=name,
        workspace=Workspace(
            boundary=floor.boundary, obstacles=floor.obstacles, notes=(floor.note,)
        ),
        robots=tuple(
            _robot(number, trip, rows, cell, bodies) for number, trip in enumerate(trips, start=1)
        ),
        tau="auto" if bodies.tau is None else bodies.tau,
        margin=bodies.margin,
    )
    problems = find_problems(made)
    if problems:
        raise fail(scen_file, _few(problems))
    return made


def read_scen(path: Path, grid: Grid | None, robots: int | None) -> list[Trip]:
    """Return the agents of a .scen file; raises InputError with every problem and its line.

    Fields are divided by tabs or spaces; a name of a map may have spaces, too.  The line with the
    version may be missing.  The first `robots` agents (None: all) have to differ in starts and in
    goals; all have to fit on the map's grid, if that is known.
    """
    text = read_bytes(path, _MOST_BYTES).decode("utf-8-sig", "backslashreplace")
    trips: list[Trip] = []
    faults: list[str] = []
    for number, line in enumerate(text.splitlines(), start=1):
        fields = line.split()
        if not fields:
            continue
        if fields[0].lower() == "version":
            if trips or faults or fields[1:] not in (["1"], ["1.0"]):
                faults.append(f"line {number}: {show(line.strip()[:60])} is not 'version 1'")
            continue
        trip = _trip(number, fields, faults)
        if trip is not None:
            trips.append(trip)
            if grid is not None:
                faults += _misplaced(trip, grid)
    faults += _doubled(trips[:robots])
    count = len(trips) if robots is None else robots
    if not faults and not len(trips) >= count > 0:
        faults.append(f"holds {len(trips)} agents, not {max(count, 1)}")
    if count > MOST_ROBOTS:
        faults.append(f"{count} agents are more than {MOST_ROBOTS}: take fewer by --robots")
    if faults:
        raise fail(path, _few(faults))
    return trips[:robots]


def _trip(number: int, fields: Sequence[str], faults: list[str]) -> Trip | None:
    """Return the agent of a line: bucket, map, width, height, start, goal, length of the way."""
    if len(fields) < 9:
        faults.append(
            f"line {number}: {len(fields)} fields, not the 9 that are bucket, map, width, height, "
            "start x, start y, goal x, goal y, length"
        )
        return None
    wrong = [
        f"line {number}: {name}: {show(printable(text[:60]))} is not a whole number"
        for name, text in zip(_FIELDS, fields[-7:-1], strict=True)
        if not _WHOLE.fullmatch(text)
    ]
    faults += wrong
    if wrong:
        return None
    width, height, *places = map(int, fields[-7:-1])
    return Trip(number, (width, height), (places[0], places[1]), (places[2], places[3]))


def _unfit(bodies: Bodies) -> Iterator[tuple[str, str]]:
    """Yield which value of the robots is out of range, and why."""
    for name, quantity in {**ROBOT_QUANTITIES, **SCENARIO_QUANTITIES}.items():
        value = getattr(bodies, name, None)
        fault = None if value is None or name == "radius" else quantity.complaint(value)
        if fault is not None:
            yield name, fault


def _misplaced(trip: Trip, grid: Grid) -> Iterator[str]:
    """Yield that an agent is for a map of another size, beside the map or on a blocked cell."""
    height, width = grid.occupied.shape
    if trip.size != (width, height):
        asked = f"{trip.size[0]} x {trip.size[1]}"
        yield f"line {trip.line}: is for a map of {asked} cells, not {width} x {height}"
        return
    for what, (x, y) in (("start", trip.start), ("goal", trip.goal)):
        if x >= width or y >= height:
            yield f"line {trip.line}: {what} {x}, {y} is beside the map"
        elif grid.occupied[height - 1 - y, x]:
            yield f"line {trip.line}: {what} {x}, {y} is a blocked cell"


def _doubled(trips: list[Trip]) -> Iterator[str]:
    """Yield whose start or goal is that of an earlier agent."""
    for what in ("start", "goal"):
        first: dict[Cell, int] = {}
        for trip in trips:
            cell: Cell = getattr(trip, what)
            line = first.setdefault(cell, trip.line)
            if line != trip.line:
                yield f"line {trip.line}: {what} {cell[0]}, {cell[1]} is that of line {line}, too"


def _few(faults: list[str]) -> list[str]:
    if len(faults) <= MOST_FAULTS:
        return faults
    return [*faults[:MOST_FAULTS], f"and {len(faults) - MOST_FAULTS} more faults of this kind"]


def _robot(number: int, trip: Trip, rows: int, cell: float, bodies: Bodies) -> Robot:
    (x, y), (gx, gy) = trip.start, trip.goal
    return Robot(
        id=f"R{number}",
        start=((x + 0.5) * cell, (rows - y - 0.5) * cell),
        goal=((gx + 0.5) * cell, (rows - gy - 0.5) * cell),
        radius=bodies.radius * cell,
        max_speed=bodies.max_speed,
        max_accel=bodies.max_accel,
        max_lateral_accel=bodies.max_accel,
        max_turn_rate=usual_turn_rate(bodies.max_accel),
    )
