"""Measuring shortest ways on one floor: our library in this process, a peer in its own interpreter.

Decides: what is timed.  Preparation is what has to be done once per floor; compiled code is loaded
before.  Our library computes only what a query needs and keeps it, so first queries cost more than
later ones; a peer computes the whole visibility graph while it prepares.
"""

from __future__ import annotations

import json
import subprocess
import time
from dataclasses import dataclass, field
from functools import cache
from statistics import median
from typing import Final

import numpy as np

from benchmarks.floors import Arena, arena
from benchmarks.table import ROOT
from coordinator.curves.nurbs import Array
from coordinator.ground.configuration_space import Ground
from coordinator.ground.free_space import NO_DISCS
from coordinator.ground.growth import Rings

PYTHON: Final = ROOT / ".venv-peers" / "bin" / "python"
WORKER: Final = ROOT / "benchmarks" / "peers" / "worker.py"

FRESH: Final = 5
"""Grounds that are prepared per round, each for one first query."""
PASSES: Final = 3
"""Grounds on which all queries are run, per round."""
QUERY_SECONDS: Final = 40.0
"""A peer starts no further query when its queries have taken this long [s]."""
LIMIT: Final = 180.0
"""A peer that would prepare for longer [s] is left out; one that does is stopped at twice that."""


@dataclass
class Measured:
    """Times [s] of preparation, of first queries and of each query; lengths and turns of the ways.

    `again`: each query's time when it is repeated.  The times of all rounds are collected; lengths
    are the same in every round.
    """

    prepare: list[float] = field(default_factory=list)
    first: list[float] = field(default_factory=list)
    queries: list[float] = field(default_factory=list)
    again: list[float] = field(default_factory=list)
    lengths: list[float | None] = field(default_factory=list)
    turns: list[int] = field(default_factory=list)

    def add(self, other: Measured) -> None:
        """Add the times of one more round."""
        self.prepare += other.prepare
        self.first += other.first
        self.queries += other.queries
        self.again += other.again
        self.lengths, self.turns = other.lengths, other.turns

    @property
    def ready(self) -> float:
        """Median time [s] from a bare floor to the first answer."""
        return median(self.prepare) + median(self.first)


def measure_ours(floor: Arena, reach: float) -> Measured:
    """Measure our library for a centre that keeps `reach` [m] from everything solid."""
    _load_kernels()
    ends = [(np.array(start), np.array(goal)) for start, goal in floor.queries]
    found = Measured()
    for number in range(FRESH):
        begin = time.perf_counter()
        ground = _ground(floor, reach)
        found.prepare.append(time.perf_counter() - begin)
        found.first.append(_ask(ground, *ends[number])[0])
    for _ in range(PASSES):
        ground = _ground(floor, reach)
        answers = [_ask(ground, start, goal) for start, goal in ends]
        found.queries += [spent for spent, _ in answers]
        found.again += [_ask(ground, start, goal)[0] for start, goal in ends]
    legs = [None if way is None else np.diff(way, axis=0) for _, way in answers]
    found.lengths = [None if one is None else float(np.hypot(*one.T).sum()) for one in legs]
    found.turns = [0 if one is None else len(one) - 1 for one in legs]
    return found


def measure_peer(library: str, floor: Arena) -> Measured | None:
    """Measure a peer; None when it was stopped because it took too long."""
    job = {
        "library": library,
        "boundary": floor.boundary,
        "polygons": floor.polygons,
        "queries": [(*start, *goal) for start, goal in floor.queries],
        "seconds": QUERY_SECONDS,
    }
    command = [str(PYTHON), str(WORKER)]
    try:
        done = subprocess.run(
            command, input=json.dumps(job), stdout=subprocess.PIPE, text=True,
            check=True, timeout=2.0 * LIMIT,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return None
    answer = json.loads(done.stdout)
    return Measured(
        prepare=[answer["prepare"]],
        first=answer["queries"][:1],
        queries=answer["queries"],
        lengths=answer["lengths"],
    )


def _ground(floor: Arena, reach: float) -> Ground:
    return Ground(Rings.of(floor.polygons, np.array(floor.boundary)), reach=reach)


def _ask(ground: Ground, start: Array, goal: Array) -> tuple[float, Array | None]:
    """Return the time [s] of a query and its way."""
    begin = time.perf_counter()
    way = ground.shortest_way(start, goal, NO_DISCS)
    return time.perf_counter() - begin, way


@cache
def _load_kernels() -> None:
    """Load the compiled code, as every process does once."""
    floor = arena(20)
    for start, goal in floor.queries:
        _ask(_ground(floor, 1e-3), np.array(start), np.array(goal))
