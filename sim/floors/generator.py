"""Scenarios generated from a kind, a number of robots and a seed: floors, starts, goals, limits.

Decides: the robots' properties, and the order in which the one random generator is used, so that
the same arguments give the same scenario on every machine.  Must not know: files and options.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import Final, NamedTuple

from coordinator.base.errors import InputError
from coordinator.scenario.model import MOST_ROBOTS, Point, Pose, Robot, Scenario
from sim.floors.cells import grid, maze, rooms
from sim.floors.corridors import corridors
from sim.floors.crowded import aisles, bays, dense, doorway, puzzle
from sim.floors.layout import LEAST_SIDE, MARGIN, MOST_SIDE, Kind, Layout, Size, Trip, Wish
from sim.floors.placing import Places
from sim.floors.polygons import polygons
from sim.floors.rings import circle, ring
from sim.floors.shelves import warehouse
from sim.floors.town import cross_town, empty
from sim.floors.traps import u_traps

KINDS: Final[dict[Kind, Callable[[Wish, Random], Layout]]] = {
    "polygons": polygons,
    "warehouse": warehouse,
    "corridors": corridors,
    "rooms": rooms,
    "u-traps": u_traps,
    "maze": maze,
    "grid": grid,
    "ring": ring,
    "circle": circle,
    "open": empty,
    "cross-town": cross_town,
}
CROWDED: Final[dict[Kind, Callable[[Wish, Random], Layout]]] = {
    "aisles": aisles,
    "bays": bays,
    "doorway": doorway,
    "dense": dense,
    "puzzle": puzzle,
}
"""Kinds on which robots have to make room for each other."""
OBSTACLES: Final[dict[Kind, str]] = {
    "polygons": "polygons",
    "warehouse": "shelves",
    "corridors": "walls",
    "u-traps": "traps",
    "grid": "blocked cells",
    "cross-town": "blocks",
}
"""What `obstacles` counts, for the kinds whose number of obstacles can be chosen."""

RADIUS: Final = 0.2
MAX_SPEED: Final = 0.8
MIXED_RADII: Final = (0.15, 0.2, 0.25, 0.3)
MIXED_SPEEDS: Final = (0.4, 0.6, 0.8, 1.0, 1.2)
MIXED_ACCELS: Final = (0.5, 1.0, 2.0)
"""Accelerations of mixed robots, in max_speed per second."""


class _Body(NamedTuple):
    """Radius [m], speed [m/s] and acceleration [m/s^2] of a robot."""

    radius: float
    speed: float
    accel: float


def generate(
    kind: Kind,
    robots: int,
    seed: int,
    size: Size | None = None,
    *,
    obstacles: int | None = None,
    headings: bool = False,
    vias: int = 0,
    mixed: bool = False,
) -> Scenario:
    """Return a scenario that passes all checks.

    Each robot has a way to its goal that avoids the starts and goals of all others, except on
    CROWDED kinds, which have neither headings nor via points.  The kind chooses `size` [m] and the
    number of `obstacles` unless they are given.  `headings` adds headings at starts and goals,
    `vias` that many via points per robot; `mixed` robots differ in radius, speed and acceleration.
    Raises InputError when the floor has no room for all this.
    """
    problems = []
    if not 1 <= robots <= MOST_ROBOTS:
        problems.append(f"--robots: must be 1 to {MOST_ROBOTS}, not {robots}")
    if size is not None and not all(LEAST_SIDE <= side <= MOST_SIDE for side in size):
        limits = f"from {LEAST_SIDE:g} m to {MOST_SIDE:g} m"
        problems.append(f"--size: {size[0]:g} m x {size[1]:g} m is not {limits} each way")
    if obstacles is not None and kind not in OBSTACLES:
        counted = ", ".join(f"{kind} ({what})" for kind, what in OBSTACLES.items())
        problems.append(f"--obstacles: can be chosen for {counted}, not for {kind}")
    if kind in CROWDED:
        wanted = {"headings": headings, "vias": vias}
        problems += [f"--{option}: {kind} has none" for option in wanted if wanted[option]]
    if problems:
        raise InputError(problems)
    dice = Random(f"{kind}-{seed}")
    bodies = [_body(dice, mixed) for _ in range(robots)]
    wish = Wish(robots, max(body.radius for body in bodies), size, obstacles)
    layout = (CROWDED if kind in CROWDED else KINDS)[kind](wish, dice)
    side = max(max(corner) for corner in layout.floor.boundary)
    if side > MOST_SIDE:
        most = f"at most {MOST_SIDE:g} m are allowed"
        raise InputError([f"--robots: {robots} need a floor {side:g} m long for {kind}, {most}"])
    places = None if kind in CROWDED else Places(layout, wish, dice)
    made = []
    for index, body in enumerate(bodies):
        if places is None:
            way = _seats(layout.trips[index], dice)
        else:
            way = places.way(index, vias, headings)
        start, via, goal = way
        made.append(
            Robot(
                id=f"R{index + 1}",
                start=start,
                goal=goal,
                via=via,
                radius=body.radius,
                max_speed=body.speed,
                max_accel=body.accel,
                max_lateral_accel=body.accel,
            )
        )
    return Scenario(
        name=f"{kind}-{robots}-{seed}", workspace=layout.floor, robots=tuple(made), margin=MARGIN
    )


def _seats(trip: Trip, dice: Random) -> tuple[Pose, tuple[Point, ...], Pose]:
    """Return start, via points and goal of a robot on a crowded floor."""
    return trip.starts.draw(dice), (), trip.goals.draw(dice)


def _body(dice: Random, mixed: bool) -> _Body:
    """Return the radius, speed and acceleration of one robot."""
    if not mixed:
        return _Body(RADIUS, MAX_SPEED, MAX_SPEED)
    speed = dice.choice(MIXED_SPEEDS)
    return _Body(dice.choice(MIXED_RADII), speed, round(speed * dice.choice(MIXED_ACCELS), 3))
