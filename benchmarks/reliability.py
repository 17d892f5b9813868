"""Fleets in virtual time with random faults: whether robots touch or wait for ever.

`python -m benchmarks.reliability --count 10000` runs seeded campaigns; with `--sweep` one robot at
a time is killed at every moment of its plan instead.  Both print tables and write them to
benchmarks/results/.  Decides: the floors and the moments.  Must not know: what a run is made of.
"""

from __future__ import annotations

import argparse
import functools
import math
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from typing import Final, NamedTuple, TypeVar

from benchmarks.campaign import record
from benchmarks.table import ROOT, Row
from coordinator.plan.document import PlanDocument
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from sim.campaigns.answer import Answer, add_up
from sim.campaigns.campaign import LINKS, Outcome, Wish, plan_for, run_one
from sim.campaigns.pool import attempt
from sim.floors.generator import KINDS, generate
from sim.world.fault_text import Fault

COUNT: Final = 500
JOBS: Final = 2
MOST_ROBOTS: Final = 8
FLOORS: Final = 4
MADE: Final = 5
"""Seeds use FLOORS floors in turn; the last of these is generated anew for every MADE of its seeds.
"""
BINS: Final = 10
SWEEPS: Final = (("paper_five", 0.1), ("17 robots", 0.5))
"""The floors, and the step [s] between moments of death."""

Answered = TypeVar("Answered")


class Death(NamedTuple):
    """A robot's death on a floor, how long [s] the others moved after it, and violations."""

    robot: str
    time: float
    tau: float
    rest: float
    violations: tuple[str, ...]


@functools.lru_cache(maxsize=16)
def floor(name: str) -> Scenario:
    """Return a floor by its name in the tables."""
    if name == "17 robots":
        return generate("polygons", 17, 1)
    if name.startswith("made "):
        number = int(name.split()[1])
        kind = tuple(KINDS)[number % len(KINDS)]
        return generate(kind, 3 + number % (MOST_ROBOTS - 2), number)
    return read_scenario(ROOT / "examples" / f"{name}.toml")


def floor_of(seed: int) -> str:
    """Return the floor that a seed runs on."""
    fixed = ("paper_five", "17 robots", "u_trap")
    return fixed[seed % FLOORS] if seed % FLOORS < len(fixed) else f"made {seed // FLOORS // MADE}"


def outcome(seed: int) -> Outcome:
    """Run one seed on its floor."""
    return attempt(floor(floor_of(seed)), seed, Wish())


def campaigns(count: int = COUNT, from_seed: int = 0, jobs: int = JOBS) -> list[Row]:
    """Return the results of `count` seeds, per floor and in all, and each violation by its seed."""
    seeds = range(from_seed, from_seed + count)
    found = _in_turn(outcome, seeds, jobs)
    groups: dict[str, list[Outcome]] = {}
    for seed, one in zip(seeds, found, strict=True):
        name = floor_of(seed)
        groups.setdefault("made" if name.startswith("made") else name, []).append(one)
    rows = [_row(name, add_up(some)) for name, some in groups.items()]
    rows.append(_row("all", add_up(found)))
    rows += [
        {"floor": floor_of(seed), "seed": seed, "said": "; ".join(one.violations)}
        for seed, one in zip(seeds, found, strict=True)
        if one.violations
    ]
    return rows


def sweep(jobs: int = JOBS) -> dict[str, list[Row]]:
    """Return tables of (last motion of any other robot - death) in shares of tau, per floor."""
    tables = {}
    for name, step in SWEEPS:
        deaths = _in_turn(partial(_death, name), _moments(name, step), jobs)
        tables[f"{name}: a robot dies, every {step} s, {len(deaths)} runs"] = _histogram(deaths)
    return tables


def _planned(name: str) -> tuple[Scenario, PlanDocument]:
    return plan_for(floor(name), LINKS[0], None)


def _moments(name: str, step: float) -> list[tuple[str, float]]:
    """Return each robot with all moments from its GO to its arrival."""
    return [
        (robot.id, round(number * step, 3))
        for robot in _planned(name)[1].robots
        for number in range(math.ceil(robot.finish_time / step))
    ]


def _death(name: str, moment: tuple[str, float]) -> Death:
    scenario, document = _planned(name)
    robot, time = moment
    seed = round(1000.0 * time)
    found = run_one(scenario, document, seed, [Fault("kill", robot, time)])
    rest = max(found.latencies.rest, default=0.0)
    return Death(robot, time, document.tau, rest, found.violations)


def _histogram(deaths: Sequence[Death]) -> list[Row]:
    """Return how many deaths have which share of tau, and each violation."""
    shares = [death.rest / death.tau for death in deaths]
    bins = [min(int(share * BINS), BINS) for share in shares]
    rows: list[Row] = [
        {"share of tau": _bin(number), "deaths": bins.count(number)} for number in range(BINS + 1)
    ]
    longest = max(deaths, key=lambda death: death.rest)
    rows.append(
        {"share of tau": "longest", "deaths": f"{longest.rest:.2f} s of {longest.tau:.2f} s"}
    )
    rows.append(
        {"share of tau": "violations", "deaths": sum(bool(one.violations) for one in deaths)}
    )
    rows += [
        {"share of tau": f"{one.robot} at {one.time} s", "deaths": "; ".join(one.violations)}
        for one in deaths
        if one.violations
    ]
    return rows


def _bin(number: int) -> str:
    return f"{number / BINS:.1f} to {(number + 1) / BINS:.1f}" if number < BINS else "above"


def _row(name: str, answer: Answer) -> Row:
    row: Row = {
        "floor": name,
        "runs": answer.runs,
        "epochs": answer.epochs,
        "collisions": answer.collisions,
        "stuck": answer.stuck,
        "arrived": answer.arrived,
        "expected": answer.expected,
        "closed in": answer.excused.get("closed in", 0),
    }
    for measure in ("freeze", "share"):
        if measure in answer.latency:
            row[f"{measure} 99 %"] = answer.latency[measure].p99
            row[f"{measure} worst"] = answer.latency[measure].worst
    return row


Asked = TypeVar("Asked")


def _in_turn(
    measure: Callable[[Asked], Answered], asked: Sequence[Asked], jobs: int
) -> list[Answered]:
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        return list(pool.map(measure, asked, chunksize=2))


def main() -> None:
    """Run the campaigns, or with --sweep the sweep."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=COUNT)
    parser.add_argument("--from-seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=JOBS)
    parser.add_argument(
        "--sweep", action="store_true", help="kill each robot at every moment instead"
    )
    chosen = parser.parse_args()
    if chosen.sweep:
        record("reliability-sweep", sweep(chosen.jobs))
    else:
        rows = campaigns(chosen.count, chosen.from_seed, chosen.jobs)
        title = f"{chosen.count} runs with 1 to 4 faults from seed {chosen.from_seed}"
        record("reliability", {title: rows})


if __name__ == "__main__":
    main()
