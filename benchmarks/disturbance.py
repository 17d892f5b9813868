"""How much later fleets arrive whose robots are stopped at random, or whose Commands are lost.

Every robot is stopped for 1 s again and again, with a share of the time from 5 to 50 %, or all
Commands are lost for some time, once in EVERY seconds.  The extra time of a robot is its arrival
less the arrival that its plan has.  It is compared with two computed figures.  ALLSTOP: everybody's
time stands while anybody under way is stopped (the naive way to keep a schedule).  The lower bound:
each robot is late by its own stops alone.

`python -m benchmarks disturbance` runs one seed of each cell; `python -m benchmarks.disturbance
--count 5` runs five.  Decides: the cells, and what is computed.
"""

from __future__ import annotations

import functools
import itertools
import math
import statistics
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

from benchmarks.campaign import WORKERS, in_turn, options, record
from benchmarks.table import Row
from coordinator.plan.document import PlanDocument
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario
from protocol.phases import FREEZE
from protocol.timeline import Timeline
from protocol.timing import MILLISECOND, SECOND
from sim.campaigns.truth import touches
from sim.floors.generator import generate
from sim.floors.layout import Kind
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.virtual_fleet import World

FLOORS: Final[dict[str, Kind]] = {"open": "open", "office": "rooms", "warehouse": "warehouse"}
"""The floors, and the generator's name of each."""
SIZES: Final = (25, 50, 100)
SHARES: Final = (0.05, 0.1, 0.2, 0.3, 0.5)
LOSSES: Final = (0.3, 1.0, 3.0)
STOP: Final = 1.0
"""How long a robot is stopped [s]."""
EVERY: Final = 15.0
"""Commands are lost once in this time [s]."""
PATIENCE: Final = 10.0
"""A run ends after this many times the plan's length; ALLSTOP then counts as infinite."""
_STEP: Final = 0.02
_PERIOD_NS: Final = 20 * MILLISECOND

Spans = list[tuple[float, float]]


class Cell(NamedTuple):
    """A floor, a number of robots, and a disturbance: a share of stops, or seconds of silence."""

    floor: str
    robots: int
    share: float = 0.0
    loss: float = 0.0

    @property
    def name(self) -> str:
        """The disturbance in words."""
        return f"stopped {self.share:.0%}" if self.share else f"no Commands for {self.loss} s"


CELLS: Final = tuple(
    Cell(floor, robots, **disturbance)
    for floor, robots in itertools.product(FLOORS, SIZES)
    for disturbance in (
        *({"share": share} for share in SHARES),
        *({"loss": loss} for loss in LOSSES),
    )
)


class Result(NamedTuple):
    """One run: mean extra times [s], who arrived, and what should not have happened."""

    extra: float
    allstop: float
    bound: float
    finish: float
    arrived: int
    touches: int
    freezes: int
    epochs: int


def measure(number: int) -> Result:
    """Run the cell and seed of this number: numbers count the cells first, then the seeds."""
    cell, seed = CELLS[number % len(CELLS)], number // len(CELLS)
    scenario, document = _planned(cell.floor, cell.robots, seed)
    lines = {one.id: one.timeline for one in drive(document)}
    finish = max(line.finish for line in lines.values())
    longest = PATIENCE * finish
    stops = _stops(cell, seed, list(lines), longest)
    silences = _silences(cell, seed, longest)
    world = _run(scenario, document, seed, stops, silences, longest)
    members = world.fleet.members.values()
    done = {m.id: (m.done_ns - world.began_ns) / SECOND for m in members if m.done_ns is not None}
    extra = [done.get(name, longest) - line.finish for name, line in lines.items()]
    return Result(
        statistics.fmean(extra),
        _allstop(lines, stops, silences),
        statistics.fmean(_alone(line, stops[name]) - line.finish for name, line in lines.items()),
        finish,
        len(done),
        len(touches(document, world.blackboxes())),
        sum(one.phase == FREEZE for one in world.fleet.incidents),
        world.fleet.epoch,
    )


def disturbance(
    count: int = 1, from_seed: int = 0, jobs: int = WORKERS, kept: Path | None = None
) -> list[Row]:
    """Return a row for each cell, over `count` seeds."""
    numbers = range(from_seed * len(CELLS), (from_seed + count) * len(CELLS))
    found = in_turn(measure, numbers, jobs, kept)
    return [_row(cell, found[index :: len(CELLS)]) for index, cell in enumerate(CELLS)]


def _row(cell: Cell, runs: Sequence[Result]) -> Row:
    return {
        "floor": cell.floor,
        "robots": cell.robots,
        "disturbance": cell.name,
        "plan s": statistics.fmean(run.finish for run in runs),
        "extra s": statistics.fmean(run.extra for run in runs),
        "ALLSTOP s": statistics.fmean(run.allstop for run in runs),
        "lower bound s": statistics.fmean(run.bound for run in runs),
        "arrived": f"{sum(run.arrived for run in runs)} of {cell.robots * len(runs)}",
        "collisions": sum(run.touches for run in runs),
        "freezes": sum(run.freezes for run in runs),
        "planned anew": sum(run.epochs - 1 for run in runs),
    }


@functools.lru_cache(maxsize=4)
def _planned(floor: str, robots: int, seed: int) -> tuple[Scenario, PlanDocument]:
    scenario = generate(FLOORS[floor], robots, seed + 1)
    return scenario, plan_scenario(scenario)


def _stops(cell: Cell, seed: int, names: Sequence[str], until: float) -> dict[str, Spans]:
    """Return when each robot is stopped: STOP seconds each time, after random times between."""
    dice = Random(f"{cell} {seed}")
    return {name: list(_spans(dice, cell.share, until)) for name in names}


def _spans(dice: Random, share: float, until: float) -> Iterator[tuple[float, float]]:
    t = 0.0
    while share and (t := t + dice.expovariate(share / (1.0 - share) / STOP)) < until:
        yield t, t + STOP
        t += STOP


def _silences(cell: Cell, seed: int, until: float) -> Spans:
    """Return when Commands are lost."""
    dice = Random(f"silence {seed}")
    if not cell.loss:
        return []
    begins = (EVERY * k + dice.uniform(0.0, EVERY - 3.0) for k in range(int(until / EVERY)))
    return [(t, t + cell.loss) for t in begins]


def _run(
    scenario: Scenario,
    document: PlanDocument,
    seed: int,
    stops: Mapping[str, Spans],
    silences: Spans,
    longest: float,
) -> World:
    faults = [
        Fault("stall", name, round(t, 3), STOP) for name, spans in stops.items() for t, _ in spans
    ]
    began: list[int] = []

    def fate(key: str, now_ns: int) -> int | None:
        t = (now_ns - began[0]) / SECOND if began and key.endswith("/command") else -1.0
        return None if any(a <= t < b for a, b in silences) else 0

    network = MemoryNetwork(seed, delay_ns=(MILLISECOND, 5 * MILLISECOND), fate=fate)
    world = World(scenario, document, network, seed=seed, faults=faults, period_ns=_PERIOD_NS)
    while not world.began_ns:
        world.step()
    began.append(world.began_ns)
    world.run(longest)
    return world


def _alone(line: Timeline, spans: Spans) -> float:
    """Return when a robot arrives that is late by its own stops alone [s].

    A stop during a rest of its plan costs it nothing before the rest would have ended.
    """
    waiting = iter(spans)
    span = next(waiting, (math.inf, math.inf))
    own = t = 0.0
    while own < line.finish:
        while span[1] <= t:
            span = next(waiting, (math.inf, math.inf))
        if t < span[0] or line.v_at(own) == 0.0:
            own += _STEP
        t += _STEP
    return t


def _allstop(lines: Mapping[str, Timeline], stops: Mapping[str, Spans], silences: Spans) -> float:
    """Return the mean extra time [s] if the whole fleet stands while anybody in it is stopped."""
    left = sorted(lines, key=lambda name: lines[name].finish)
    waiting = {name: iter(stops[name]) for name in left}
    spans = {name: next(waiting[name], (math.inf, math.inf)) for name in left}
    quiet, late, own, t = iter(silences), 0.0, 0.0, 0.0
    silence = next(quiet, (math.inf, math.inf))
    while left:
        while silence[1] <= t:
            silence = next(quiet, (math.inf, math.inf))
        stands = silence[0] <= t
        for name in left:
            while spans[name][1] <= t:
                spans[name] = next(waiting[name], (math.inf, math.inf))
            stands |= spans[name][0] <= t
        own += 0.0 if stands else _STEP
        t += _STEP
        if t > PATIENCE * lines[left[-1]].finish:
            return math.inf
        while left and lines[left[0]].finish <= own:
            late += t - lines[left.pop(0)].finish
    return late / len(lines)


if __name__ == "__main__":
    asked = options(__doc__, 5, 0)
    rows = disturbance(asked.count, asked.from_seed, asked.jobs, asked.kept)
    record("disturbance", {"robots stopped, Commands lost": rows})
