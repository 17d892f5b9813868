"""Plans for robots that have to make room for each other, beside the discrete search alone.

`python -m benchmarks.making_room --count 20 --from-seed 0` plans the rows below for that many seeds
each.  A scenario that the search over places solves on its graph should have a plan.  Times are
those of one core, so that other work on the machine does not count.

Decides: the scenarios and what is compared.  Must not know: how plans are found.
"""

from __future__ import annotations

import math
import time
from random import Random
from statistics import median
from typing import Final, NamedTuple

from msgspec.structs import replace

from benchmarks.campaign import options, record
from benchmarks.table import Row
from coordinator.base.errors import PlanError
from coordinator.ground.grown_floor import GrownFloor
from coordinator.places.move_kernels import SOLVED
from coordinator.places.moves import find_moves
from coordinator.places.place_graph import place_graph
from coordinator.planning.planner import DEFAULT_EFFORT, plan_scenario
from coordinator.scenario.model import Robot, Scenario, Workspace
from sim.floors.generator import MAX_SPEED, RADIUS, generate
from sim.floors.layout import MARGIN, SLACK

COUNT: Final = 20
SOON: Final = 10.0
"""A plan for up to 100 robots should take no longer than this [s]."""
SIDES: Final = 44
RING: Final = 10


class Tried(NamedTuple):
    """Whether the discrete search and the planner solved a scenario, and their times [s]."""

    discrete: bool
    searching: float
    planned: bool
    planning: float


def making_room(count: int, from_seed: int = 0, effort: int = DEFAULT_EFFORT) -> list[Row]:
    """Return a row for each kind and size, over `count` seeds."""
    seeds = range(from_seed, from_seed + count)
    rows = [("aisles", n, 0.0) for n in (20, 40, 60, 100)]
    rows += [("doorway", n, 0.0) for n in (4, 8, 12, 20)]
    rows += [("bays", n, 0.0) for n in (2, 3)]
    rows += [("dense", n, share) for n in (50, 100) for share in (0.1, 0.15, 0.2)]
    rows += [("puzzle", n, 0.0) for n in (3, 8)]
    table = []
    for kind, robots, share in rows:
        tries = [_tried(_made(kind, robots, share, seed), effort) for seed in seeds]
        table.append(_row(f"{kind} {share:.0%}" if share else kind, robots, tries))
    for shift in range(1, 6):
        tries = [_tried(ring_with_a_hole(shift, seed), effort) for seed in seeds]
        table.append(_row(f"ring, shift {shift}", RING, tries))
    return table


def _made(kind: str, robots: int, share: float, seed: int) -> Scenario:
    side = math.ceil(10.0 * math.sqrt(robots * math.pi * RADIUS**2 / share)) / 10.0 if share else 0
    return generate(kind, robots, seed, (side, side) if share else None)  # type: ignore[arg-type]


def ring_with_a_hole(shift: int, seed: int) -> Scenario:
    """Return robots on a ring of one lane with one seat more; each goes `shift` robots further."""
    seats = RING + 1
    radius = 0.5 * (2.0 * RADIUS + MARGIN + 2.0 * SLACK) / math.sin(math.pi / seats)
    reach = RADIUS + MARGIN + SLACK
    middle = radius + reach + 0.1
    wall = (radius + reach) / math.cos(math.pi / SIDES)
    rings = [
        tuple(_on(middle, size, math.tau * k / SIDES) for k in range(SIDES))
        for size in (wall, radius - reach)
    ]
    hole = Random(seed).randrange(seats)
    places = [_on(middle, radius, math.tau * ((hole + k) % seats) / seats) for k in range(1, seats)]
    robots = [
        Robot(
            id=f"R{k + 1}", start=places[k], goal=places[(k + shift) % RING], radius=RADIUS,
            max_speed=MAX_SPEED, max_accel=MAX_SPEED, max_lateral_accel=MAX_SPEED,
        )
        for k in range(RING)
    ]  # fmt: skip
    floor = Workspace(boundary=rings[0], obstacles=(rings[1],))
    bare = Scenario(name=f"ring-{shift}-{seed}", workspace=floor, robots=(), margin=MARGIN)
    return replace(bare, robots=tuple(robots))


def _on(middle: float, radius: float, angle: float) -> tuple[float, float]:
    return middle + radius * math.cos(angle), middle + radius * math.sin(angle)


def _tried(scenario: Scenario, effort: int) -> Tried:
    marks = [time.process_time()]
    floor = GrownFloor(scenario.workspace.boundary, scenario.workspace.obstacles)
    graph = place_graph(scenario, floor, [robot.radius for robot in scenario.robots])
    discrete = graph is not None and find_moves(graph)[0] == SOLVED
    marks.append(time.process_time())
    try:
        planned = plan_scenario(scenario, effort=effort).proof.holds
    except PlanError:
        planned = False
    marks.append(time.process_time())
    return Tried(discrete, marks[1] - marks[0], planned, marks[2] - marks[1])


def _row(name: str, robots: int, tries: list[Tried]) -> Row:
    found = [one for one in tries if one.planned]
    return {
        "kind": name,
        "robots": robots,
        "scenarios": len(tries),
        "discrete": sum(one.discrete for one in tries),
        "median [s]": median(one.searching for one in tries),
        "planned": len(found),
        f"within {SOON:g} s": sum(one.planning <= SOON for one in found),
        "median plan [s]": median(one.planning for one in tries),
        "worst [s]": max(one.planning for one in tries),
    }


def main() -> None:
    """Run the campaign that the command line names."""
    chosen = options(__doc__, COUNT, DEFAULT_EFFORT)
    rows = making_room(chosen.count, chosen.from_seed, chosen.effort)
    record("ways", {f"{chosen.count} scenarios a row, from seed {chosen.from_seed}": rows})


if __name__ == "__main__":
    main()
