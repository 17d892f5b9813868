"""Fleets of discs on maps of MovingAI's kinds: who is solved, and how early robots arrive.

Agents of the benchmark start and stop at once, so robots do, too, and tau is 0.3 s.  "On the grid"
is this project's search for moves from cell to cell, by discs that may follow each other closely
and turn on the spot, with the same speed.

Decides: maps, sizes, robots, and what plans are compared with.
"""

from __future__ import annotations

import math
import time
from pathlib import Path
from statistics import fmean, median
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

import numpy as np

from benchmarks.campaign import parser_of, record
from benchmarks.movingai_maps import NAMES, drawn
from benchmarks.table import Row
from coordinator.base.errors import PlanError
from coordinator.exchange.movingai import Bodies, scenario_of
from coordinator.places.early_moves import early_plans
from coordinator.places.move_kernels import SOLVED, Edges, Team, costs_to
from coordinator.places.moves import find_moves
from coordinator.places.place_graph import Graph
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario

SIZES: Final = (10, 20, 50, 100)
SOON: Final = 30.0
"""A plan for up to 100 robots should take no longer than this [s]."""

_DISCS: Final = Bodies(radius=0.35, max_speed=1.0, max_accel=math.inf, tau=0.3, margin=0.05)


class Tried(NamedTuple):
    """CPU time [s] of a plan, its arrivals [s], if there is one, and their sum on the grid."""

    took: float
    arrivals: list[float]
    on_grid: float


def movingai(
    count: int = 1,
    from_seed: int = 0,
    names: tuple[str, ...] = NAMES,
    sizes: tuple[int, ...] = SIZES,
) -> list[Row]:
    """Return a row for each kind of map and number of robots, over `count` maps drawn by seeds."""
    seeds = range(from_seed, from_seed + count)
    return [
        _row(name, robots, [_tried(name, robots, seed) for seed in seeds])
        for name in names
        for robots in sizes
    ]


def _tried(name: str, robots: int, seed: int) -> Tried:
    map_text, scen_text = drawn(name, robots, seed)
    with TemporaryDirectory() as folder:
        map_file, scen_file = Path(folder) / f"{name}.map", Path(folder) / f"{name}.scen"
        map_file.write_text(map_text)
        scen_file.write_text(scen_text)
        scenario = scenario_of(map_file, scen_file, robots, 1.0, _DISCS, name)
    begun = time.process_time()
    try:
        plan = plan_scenario(scenario)
    except PlanError:
        arrivals = []
    else:
        arrivals = [robot.finish_time for robot in plan.robots]
    took = time.process_time() - begun
    return Tried(took, arrivals, _on_grid(map_text, scenario))


def _on_grid(map_text: str, scenario: Scenario) -> float:
    """Return the sum of arrivals [s] of moves from cell to cell; infinite if none are found."""
    graph = _cells(map_text, scenario)
    outcome, moves = find_moves(graph)
    if outcome != SOLVED:
        return math.inf
    metres = early_plans(graph, moves, 0.0)[0].arrival.sum()
    return float(metres) / scenario.planned_speed(scenario.robots[0])


def _cells(map_text: str, scenario: Scenario) -> Graph:
    """Return the graph of the free cells of a map, joined to their neighbours."""
    rows = map_text.splitlines()[4:]
    places = sorted(
        (x + 0.5, len(rows) - y - 0.5)
        for y, row in enumerate(rows)
        for x, cell in enumerate(row)
        if cell == "."
    )
    number = {place: k for k, place in enumerate(places)}
    pairs = [
        (k, number[there])
        for k, (x, y) in enumerate(places)
        for there in ((x - 1.0, y), (x, y - 1.0), (x, y + 1.0), (x + 1.0, y))
        if there in number
    ]
    origin, to = np.array(pairs).T.copy()
    ones, at = np.ones(len(pairs)), np.array(places)
    edges = Edges(
        np.searchsorted(origin, np.arange(len(places) + 1)), to, ones,
        np.arange(0, 2 * len(pairs) + 1, 2), np.array(pairs).ravel(), np.zeros(2 * len(pairs)),
        origin, np.lexsort((origin, to)),
    )  # fmt: skip
    fits, robots = np.ones((1, len(pairs)), np.bool_), scenario.robots
    starts, goals = np.array(
        [[number[end[0], end[1]] for end in (one.start, one.goal)] for one in robots]
    ).T.copy()
    left = [costs_to(goals[k : k + 1], edges, fits[0], 0.0 * ones) for k in range(len(robots))]
    nothing, need = np.zeros(len(robots), np.int64), 2.0 * robots[0].radius + scenario.margin
    team = Team(
        nothing, starts, goals, np.array(left), nothing,
        np.arange(len(places)) == goals[:, None], np.full((1, 1), need), fits,
        np.zeros(len(robots), np.bool_),
    )  # fmt: skip
    return Graph(at, edges, [at[list(pair)] for pair in pairs], team)


def _row(name: str, robots: int, tries: list[Tried]) -> Row:
    found = [one for one in tries if one.arrivals]
    row: Row = {
        "map": name,
        "robots": robots,
        "maps": len(tries),
        "solved": len(found),
        f"within {SOON:g} s": sum(one.took <= SOON for one in found),
        "median [s]": median(one.took for one in tries),
        "worst [s]": max(one.took for one in tries),
    }
    if found:
        ratios = [sum(one.arrivals) / one.on_grid for one in found]
        row |= {
            "sum of arrivals [s]": fmean(sum(one.arrivals) for one in found),
            "on the grid [s]": fmean(one.on_grid for one in found),
            "ratio": fmean(ratios),
            "last arrival [s]": fmean(max(one.arrivals) for one in found),
        }
    return row


def main() -> None:
    """Run the campaign that the command line names."""
    parser = parser_of(__doc__, 5)
    parser.add_argument("--maps", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--sizes", nargs="+", type=int, default=SIZES, help="numbers of robots")
    chosen = parser.parse_args()
    rows = movingai(chosen.count, chosen.from_seed, tuple(chosen.maps), tuple(chosen.sizes))
    record("movingai", {f"{chosen.count} maps a row, from seed {chosen.from_seed}": rows})


if __name__ == "__main__":
    main()
