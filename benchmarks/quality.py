"""How near to the optimum the waits are: seeded scenarios, compared with CP-SAT over all orders.

`python -m benchmarks.quality --count 200 --from-seed 0` prints tables and writes them, worst cases
with their seeds included, to benchmarks/results/.  Decides: the scenarios and what is compared.
Must not know: how plans are found.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from random import Random
from statistics import mean, median
from typing import Final, NamedTuple

from msgspec.structs import replace

from benchmarks.campaign import WORKERS, in_turn, options, record
from benchmarks.table import Row
from coordinator.base.errors import InputError, PlanError
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario
from sim.floors.generator import generate
from sim.floors.layout import Kind
from tests.optimum import least_delay
from tests.oracle_zones import Course, find_zones
from tests.oracles import tracks

COUNT: Final = 200
EFFORT: Final = 100
TITLE: Final = "sums of delays against the optimum"
MOST_ROBOTS: Final = 7
KINDS: Final[tuple[Kind, ...]] = (
    "open", "circle", "cross-town", "polygons", "rooms", "corridors", "warehouse", "ring",
)  # fmt: skip
TAUS: Final = (0.3, 0.5, 1.0)
SIDE: Final = 2.0
"""The first side [m] of the floor that is tried, per square root of the number of robots; it is
small so that robots conflict."""
SMALL: Final = 1.0
"""The least divisor [s] when an excess is taken as a share of the delays."""
STEP: Final = 0.005
"""The step of the oracle's grid [m]; because of it the optimum is too good by about 0.5 %."""
WORST: Final = 8


class Found(NamedTuple):
    """One scenario: sums of delays [s] of our plan and of the optimum, times [s] that they took."""

    seed: int
    name: str
    robots: int
    ours: float
    best: float
    proven: bool
    planning: float
    solving: float

    @property
    def excess(self) -> float:
        """By how much our delays exceed the optimum, as a share of it."""
        return (self.ours - self.best) / max(self.best, SMALL)


def scene(seed: int) -> Scenario:
    """Return a seeded scenario of 2 to 7 robots without inertia on the smallest floor that fits."""
    dice = Random(f"quality-{seed}")
    kind = KINDS[seed % len(KINDS)]
    robots = dice.randint(2, MOST_ROBOTS)
    tau, mixed = dice.choice(TAUS), dice.random() < 0.5
    for width in _widths(robots):
        try:
            made = generate(kind, robots, seed, (width, round(0.8 * width, 1)), mixed=mixed)
        except InputError:
            continue
        at_once = (
            replace(robot, max_accel=math.inf, max_lateral_accel=math.inf, max_turn_rate=math.inf)
            for robot in made.robots
        )
        return replace(made, robots=tuple(at_once), tau=tau)
    raise AssertionError(f"{kind} does not fit {robots} robots")


def _widths(robots: int) -> Iterator[float]:
    width = SIDE * math.sqrt(robots) + 2.0
    for _ in range(30):
        yield round(width, 1)
        width *= 1.12


def courses_of(document: PlanDocument, scenario: Scenario) -> tuple[list[Course], float]:
    """Return the oracle's form of a plan's paths, and the plan's sum of delays [s]."""
    fleet = tracks(to_json(document))
    courses = [
        Course.of(track, scenario.planned_speed(robot), STEP)
        for track, robot in zip(fleet, scenario.robots, strict=True)
    ]
    alone = sum(course.alone for course in courses)
    return courses, sum(track.finish for track in fleet) - alone


def measure(seed: int, effort: int = EFFORT) -> Found | str:
    """Return one scenario's delays, or why there is no plan."""
    scenario = scene(seed)
    begin = time.perf_counter()
    try:
        document = plan_scenario(scenario, effort=effort)
    except PlanError as error:
        return f"{seed}: {scenario.name}: {error}"
    planned = time.perf_counter()
    courses, ours = courses_of(document, scenario)
    best = least_delay(courses, find_zones(courses, document.margin), document.tau, ours)
    if best is None:
        return f"{seed}: {scenario.name}: the oracle finds no schedule where ours lasts {ours:.3f}"
    took = planned - begin, time.perf_counter() - planned
    name, robots = scenario.name, len(scenario.robots)
    return Found(seed, name, robots, ours, best.delay, best.proven, *took)


def quality(
    count: int = COUNT,
    from_seed: int = 0,
    effort: int = EFFORT,
    jobs: int = WORKERS,
    kept: Path | None = None,
) -> list[Row]:
    """Return our delays and the optimum: for all scenarios, by number of robots, and the worst."""
    seeds = range(from_seed, from_seed + count)
    answers = in_turn(partial(measure, effort=effort), seeds, jobs, kept)
    found = [answer for answer in answers if isinstance(answer, Found)]
    rows = [_summary("all", found)]
    for robots in sorted({one.robots for one in found}):
        same = [one for one in found if one.robots == robots]
        rows.append(_summary(f"{robots} robots", same))
    worst = sorted(found, key=lambda one: -one.excess)[:WORST]
    rows += [_summary(f"seed {one.seed}, {one.name}", [one]) for one in worst]
    rows += [{"what": answer} for answer in answers if isinstance(answer, str)]
    return rows


def _summary(what: str, found: list[Found]) -> Row:
    waiting = [one for one in found if one.best > 0.0]
    best = sum(one.best for one in found)
    return {
        "what": what,
        "scenarios": len(found),
        "somebody waits": len(waiting),
        "mean excess %": 100.0 * mean(one.excess for one in found),
        "excess of sums %": 100.0 * (sum(one.ours for one in found) - best) / max(best, SMALL),
        "worst %": 100.0 * max(one.excess for one in found),
        "delay s": mean(one.ours for one in found),
        "optimum s": mean(one.best for one in found),
        "below optimum": sum(one.ours < one.best - 1e-3 for one in found),
        "not proven": sum(not one.proven for one in found),
        "plan s": median(one.planning for one in found),
        "CP-SAT s": median(one.solving for one in found),
    }


def main() -> None:
    """Measure the scenarios that the command line names."""
    chosen = options(__doc__, COUNT, EFFORT)
    rows = quality(chosen.count, chosen.from_seed, chosen.effort, chosen.jobs, chosen.kept)
    record("quality", {TITLE: rows})


if __name__ == "__main__":
    main()
