"""Fleets in virtual time with random faults: whether robots touch or wait for ever.

`python -m benchmarks.reliability --count 10000` runs seeded campaigns; with `--sweep` one robot at
a time is killed at every moment of its plan, or at a random one, instead.  Both print tables and
write them to benchmarks/results/.  Decides: the floors and the moments.  Must not know: what a run
is made of.
"""

from __future__ import annotations

import functools
import math
import statistics
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

from benchmarks.campaign import WORKERS, in_turn, parser_of, record
from benchmarks.table import ROOT, Row
from coordinator.plan.document import PlanDocument
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from sim.campaigns.answer import Answer, add_up
from sim.campaigns.campaign import LINKS, Outcome, Wish, plan_for, run_one
from sim.campaigns.pool import attempt
from sim.floors.generator import KINDS, generate
from sim.world.fault_text import Fault
from sim.world.virtual_fleet import World

COUNT: Final = 500
MOST_ROBOTS: Final = 8
FLOORS: Final = 4
MADE: Final = 5
"""Seeds use FLOORS floors in turn; the last of these is generated anew for every MADE of its seeds.
"""
SWEEPS: Final = (("paper_five", 0.1), ("17 robots", 0.5))
"""The floors on which every robot dies at every moment, and the step [s] between the moments."""
LARGE: Final = (("100 open", 100), ("100 warehouse", 100))
"""The floors on which random robots die at random moments, and how many deaths."""


class Death(NamedTuple):
    """A robot's death on a floor: who was under way, who was held by it, and what was wrong.

    `around`: whether others were sent around it.
    """

    robot: str
    time: float
    under_way: int
    held: int
    around: bool
    violations: tuple[str, ...]


@functools.lru_cache(maxsize=16)
def floor(name: str) -> Scenario:
    """Return a floor by its name in the tables."""
    if name == "17 robots":
        return generate("polygons", 17, 1)
    if name == "100 open":
        return generate("open", 100, 1)
    if name == "100 warehouse":
        return generate("warehouse", 100, 1)
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


def campaigns(
    count: int = COUNT, from_seed: int = 0, jobs: int = WORKERS, kept: Path | None = None
) -> list[Row]:
    """Return the results of `count` seeds, per floor and in all, and each violation by its seed."""
    seeds = range(from_seed, from_seed + count)
    found = in_turn(outcome, seeds, jobs, kept)
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


def sweep(jobs: int = WORKERS, kept: Path | None = None) -> dict[str, list[Row]]:
    """Return tables of how many robots a dead one holds, per floor."""
    tables = {}
    for name, step in SWEEPS:
        deaths = in_turn(partial(_death, name), _moments(name, step), jobs, kept)
        tables[f"{name}: every robot dies every {step} s, {len(deaths)} runs"] = _held(deaths)
    for name, count in LARGE:
        deaths = in_turn(partial(_death, name), _random_moments(name, count), jobs, kept)
        tables[f"{name}: random deaths, {count} runs"] = _held(deaths)
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


def _random_moments(name: str, count: int) -> list[tuple[str, float]]:
    """Return random robots with random moments from their GO to their arrival."""
    dice, robots = Random(name), _planned(name)[1].robots
    chosen = [dice.choice(robots) for _ in range(count)]
    return [(robot.id, round(dice.uniform(0.0, robot.finish_time), 3)) for robot in chosen]


def _death(name: str, moment: tuple[str, float]) -> Death:
    scenario, document = _planned(name)
    robot, time = moment
    under_way = sum(one.finish_time > time for one in document.robots) - 1
    held, around = set[str](), False

    def look(world: World) -> None:
        nonlocal around
        around = around or robot in world.fleet.grants.given_up
        if world.struck and not around:
            held.update(one.robot for one in world.fleet.held())

    faults = [Fault("kill", robot, time)]
    found = run_one(scenario, document, round(1000.0 * time), faults, watch=look)
    return Death(robot, time, under_way, len(held - {robot}), around, found.violations)


def _held(deaths: Sequence[Death]) -> list[Row]:
    """Return how many robots were held, in how many runs nobody was, and each violation."""
    held = sorted(death.held for death in deaths)
    rows: list[Row] = [
        {
            "what": "robots under way beside the dead one, mean",
            "deaths": _mean(deaths, "under_way"),
        },
        {"what": "robots held by it, mean", "deaths": _mean(deaths, "held")},
        {"what": "robots held by it, 95 %", "deaths": held[math.ceil(0.95 * len(held)) - 1]},
        {"what": "runs in which nobody was held", "deaths": held.count(0)},
        {"what": "runs with others sent around", "deaths": sum(death.around for death in deaths)},
        {"what": "violations", "deaths": sum(bool(one.violations) for one in deaths)},
    ]
    rows += [
        {"what": f"{one.robot} at {one.time} s", "deaths": "; ".join(one.violations)}
        for one in deaths
        if one.violations
    ]
    return rows


def _mean(deaths: Sequence[Death], field: str) -> float:
    return statistics.fmean(getattr(death, field) for death in deaths)


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
        "too near": answer.excused.get("too near", 0),
    }
    if "around" in answer.latency:
        row["around 99 %"] = answer.latency["around"].p99
        row["around worst"] = answer.latency["around"].worst
    return row


def main() -> None:
    """Run the campaigns, or with --sweep the sweep."""
    parser = parser_of(__doc__, COUNT)
    parser.add_argument(
        "--sweep", action="store_true", help="kill each robot at every moment instead"
    )
    chosen = parser.parse_args()
    if chosen.sweep:
        record("reliability-sweep", sweep(chosen.jobs, chosen.kept))
    else:
        rows = campaigns(chosen.count, chosen.from_seed, chosen.jobs, chosen.kept)
        title = f"{chosen.count} runs with 1 to 4 faults from seed {chosen.from_seed}"
        record("reliability", {title: rows})


if __name__ == "__main__":
    main()
