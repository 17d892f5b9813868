"""Fleets beyond every time that anything allows for: nobody may touch, and everybody arrives.

Reports take 2 s longer, clocks jump by 6 s either way or drift by 1 %, the coordinator is away for
5 s, links are cut for 6 s, all in each run, without deaths.  `python -m benchmarks.beyond --count
500` runs that many seeds at each tau, and some of them with the rule switched off, of which some
have to touch.  Decides: the floors, and what goes wrong.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

from msgspec.structs import replace

from benchmarks.campaign import WORKERS, in_turn, options, record
from benchmarks.table import Row
from coordinator.base.errors import PlanError
from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario
from protocol.timing import MILLISECOND, SECOND
from sim.campaigns.campaign import run_world
from sim.campaigns.truth import arrived, touches
from sim.floors.generator import generate
from sim.floors.layout import Kind
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.virtual_fleet import Flaws, World

FLOORS: Final[tuple[tuple[Kind, int], ...]] = (
    ("warehouse", 12),
    ("open", 10),
    ("rooms", 8),
    ("ring", 10),
    ("polygons", 8),
)
TAUS: Final[tuple[float | str, ...]] = ("auto", 0.3)
FLAWS: Final = Flaws(gain=0.01, noise=0.001)
DRIFT_PPM: Final = 10_000
DELAY_NS: Final = 2 * SECOND
CUT: Final = 6.0
AWAY: Final = 5.0
JUMP: Final = 6.0
LOSS: Final = 0.1
_PERIOD_NS: Final = 20 * MILLISECOND
_MADE: Final = 20
"""Every floor is generated anew after this many of its seeds."""


class Way(NamedTuple):
    """Under which conditions the seeds run."""

    tau: float | str
    authority: bool


WAYS: Final = tuple(Way(tau, authority) for tau in TAUS for authority in (True, False))
OFF: Final = 5
"""Without the rule only one of so many seeds runs."""


class Result(NamedTuple):
    """One run: robots that touched and that did not arrive, epochs, and how late the last was."""

    floor: str
    seed: int
    touches: tuple[str, ...]
    missing: tuple[str, ...]
    epochs: int
    late: float


def measure(number: int) -> Result | None:
    """Run the seed and way of this number, if it has a run: numbers count the ways first."""
    way, seed = WAYS[number % len(WAYS)], number // len(WAYS)
    if not way.authority and seed % OFF:
        return None
    kind, robots = FLOORS[seed % len(FLOORS)]
    scenario, document = _planned(kind, robots, seed // len(FLOORS) // _MADE, way.tau)
    dice = Random(seed)
    names = [robot.id for robot in document.robots]
    finish = max(robot.finish_time for robot in document.robots)
    network = MemoryNetwork(
        seed,
        loss=LOSS,
        delay_ns=(0, 100 * MILLISECOND),
        fate=lambda key, _now_ns: DELAY_NS if "/report/" in key else 0,
    )
    world = World(
        scenario,
        document,
        network,
        seed=seed,
        faults=_faults(dice, names, finish),
        flaws=FLAWS,
        period_ns=_PERIOD_NS,
        authority=way.authority,
    )
    while not world.began_ns:
        world.step()
    for robot in world.robots.values():
        robot.own_clock.drift(dice.choice((-DRIFT_PPM, 0, DRIFT_PPM)))
    _, over_ns = run_world(world, document)
    boxes = world.blackboxes()
    missing = set(names) - arrived(world, document, boxes)
    late = (over_ns - world.began_ns) / SECOND - finish
    found = tuple(touch.text() for touch in touches(document, boxes))
    return Result(kind, seed, found, tuple(sorted(missing)), world.fleet.epoch, late)


def _faults(dice: Random, names: Sequence[str], finish: float) -> list[Fault]:
    """Return what goes wrong in a run: each kind at least once, and stalls for the rule to bear."""

    def at() -> float:
        return round(dice.uniform(0.0, finish), 2)

    faults = [Fault("coordinator-hang", "", at(), AWAY)]
    for _ in range(max(len(names) // 4, 1)):
        faults.append(Fault("clock-jump", dice.choice(names), at(), dice.choice((-JUMP, JUMP))))
        faults.append(Fault("cut", dice.choice(names), at(), CUT))
        faults.append(Fault("stall", dice.choice(names), at(), round(dice.uniform(1.0, 6.0), 2)))
    return sorted(faults, key=lambda fault: fault.time)


@functools.lru_cache(maxsize=8)
def _planned(
    kind: Kind, robots: int, number: int, tau: float | str
) -> tuple[Scenario, PlanDocument]:
    """Return a floor and its plan; floors without a plan are passed over."""
    for attempt in range(100):
        scenario = replace(generate(kind, robots, 100 * number + attempt), tau=tau)
        try:
            return scenario, plan_scenario(scenario)
        except PlanError:
            continue
    raise AssertionError(f"no {kind} of {robots} robots has a plan")


def beyond(
    count: int = 20, from_seed: int = 0, jobs: int = WORKERS, kept: Path | None = None
) -> list[Row]:
    """Return a row for each way, over `count` seeds, and one for each seed that went wrong."""
    numbers = range(from_seed * len(WAYS), (from_seed + count) * len(WAYS))
    found = in_turn(measure, numbers, jobs, kept)
    rows: list[Row] = []
    for index, way in enumerate(WAYS):
        runs = [run for run in found[index :: len(WAYS)] if run is not None]
        rows.append(
            {
                "tau": str(way.tau),
                "authority": "on" if way.authority else "off",
                "runs": len(runs),
                "runs that touch": sum(bool(run.touches) for run in runs),
                "runs in which robots are missing": sum(bool(run.missing) for run in runs),
                "epochs": sum(run.epochs for run in runs) / len(runs),
                "last arrival late by s": sum(run.late for run in runs) / len(runs),
            }
        )
        rows += [
            {"tau": str(way.tau), "floor": run.floor, "seed": run.seed, "said": said}
            for run in runs
            if way.authority
            for said in (*run.touches, *run.missing)
        ]
    return rows


if __name__ == "__main__":
    asked = options(__doc__, 500, 0)
    rows = beyond(asked.count, asked.from_seed, asked.jobs, asked.kept)
    record("beyond", {"beyond every budget": rows})
