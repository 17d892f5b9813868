"""Seeded scenarios of all kinds: whether every plan is safe, and no scenario refused needlessly.

`python -m benchmarks.safety --count 2000 --from-seed 0` prints a table per kind and writes it to
benchmarks/results/.  Decides: the scenarios and the questions.  Must not know: how plans are found.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from random import Random
from statistics import median
from typing import Final, Literal, NamedTuple

from msgspec.structs import replace

from benchmarks.campaign import WORKERS, in_turn, options, record
from benchmarks.table import Row
from coordinator.base.errors import InputError, PlanError
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import to_json
from coordinator.planning.planner import DEFAULT_EFFORT, plan_scenario
from coordinator.scenario.model import Scenario
from sim.floors.generator import KINDS, generate
from sim.floors.layout import Size
from tests.oracle_dense import closest
from tests.oracles import tracks

COUNT: Final = 200
FEWEST: Final = 5
MOST: Final = 60
TAUS: Final = ("auto", "auto", 0.2, 0.5, 1.0)
SAID: Final = 120
"""How many characters of the planner's message the table shows."""
SHORT: Final = 1e-4
"""A violation is a distance at least this much [m] below the need: the sampler is not more exact.
"""

Ending = Literal["planned", "violated", "no path", "place crossed", "not proven", "for nothing"]
ENDINGS: Final[tuple[Ending, ...]] = (
    "planned", "violated", "no path", "place crossed", "not proven", "for nothing",
)  # fmt: skip
"""How planning a scenario may end.

planned: the proof and the dense sampler find the plan safe; violated: one of them does not.  The
others are refusals.  no path: a robot has none; place crossed: some path crosses another robot's
place; not proven: the plan failed its proof; for nothing: without need, because all paths keep off
all places, so any order of the robots would work.
"""


class Outcome(NamedTuple):
    """The outcome of one scenario; `slack` [m] is the dense sampler's, `seconds` the planner's."""

    seed: int
    kind: str
    robots: int
    ending: Ending
    said: str
    slack: float
    seconds: float


def scene(seed: int, most: int = MOST) -> Scenario:
    """Return a seeded scenario of 5 to `most` robots: kinds in turn, all else at random."""
    dice = Random(f"safety-{seed}")
    kind = tuple(KINDS)[seed % len(KINDS)]
    robots = dice.randint(FEWEST, most)
    mixed, at_once, headings = dice.random() < 0.5, dice.random() < 0.5, dice.random() < 0.25
    vias, crowded, tau = dice.choice((0, 0, 0, 1, 2)), dice.random() < 0.5, dice.choice(TAUS)
    sizes = list(_sizes(robots)) if crowded else []
    wishes = [(size, headings, vias) for size in sizes]
    wishes += [(None, headings, vias), (None, False, vias), (None, False, 0)]
    for size, headed, passed in wishes:
        try:
            made = generate(kind, robots, seed, size, headings=headed, vias=passed, mixed=mixed)
        except InputError:
            continue
        if at_once:
            free = {"max_accel": math.inf, "max_lateral_accel": math.inf}
            made = replace(made, robots=tuple(replace(robot, **free) for robot in made.robots))
        return replace(made, tau=tau)
    raise AssertionError(f"no {kind} for {robots} robots")


def _sizes(robots: int) -> Iterator[Size]:
    """Yield small floors [m], the smallest first."""
    for share in (1.0, 1.25, 1.5):
        side = share * (2.5 * math.sqrt(robots) + 2.0)
        yield round(side, 1), round(side, 1)


def outcome(seed: int, most: int = MOST, effort: int = DEFAULT_EFFORT) -> Outcome:
    """Plan one scenario and judge the result."""
    scenario = scene(seed, most)
    begin = time.perf_counter()
    slack, said = math.nan, ""
    try:
        document = plan_scenario(scenario, effort=effort)
        seconds = time.perf_counter() - begin
        ending, slack, said = _judged(document)
    except PlanError as error:
        seconds = time.perf_counter() - begin
        ending, said = _refused(scenario, error), str(error)
    kind = scenario.name.rsplit("-", 2)[0]
    return Outcome(seed, kind, len(scenario.robots), ending, said, slack, seconds)


def _judged(document: PlanDocument) -> tuple[Ending, float, str]:
    """Judge a plan by its proof and by the dense sampler, which uses only the plan's numbers."""
    fleet = tracks(to_json(document))
    worst = closest(fleet, document.tau, document.margin)
    proof = document.proof
    if proof is None or not proof.holds:
        return "violated", worst.slack, "; ".join(proof.failures) if proof else "no proof"
    if worst.slack < -SHORT:
        return "violated", worst.slack, f"{worst.who} at {worst.when}"
    return "planned", worst.slack, ""


def _refused(scenario: Scenario, error: PlanError) -> Ending:
    """Return why there is no plan, as far as the paths show."""
    if "does not pass its proof" in str(error):
        return "not proven"
    finder = Pathfinder(scenario)
    try:
        crossed = [
            sentence
            for index in range(len(scenario.robots))
            for sentence in finder.crossed_places(index, finder.path(index))
        ]
    except PlanError:
        return "no path"
    return "place crossed" if crossed else "for nothing"


def safety(
    count: int = COUNT,
    from_seed: int = 0,
    effort: int = DEFAULT_EFFORT,
    jobs: int = WORKERS,
    kept: Path | None = None,
) -> list[Row]:
    """Return the endings per kind and in all, and a row for each scenario to look at."""
    seeds = range(from_seed, from_seed + count)
    found = in_turn(partial(outcome, effort=effort), seeds, jobs, kept)
    kinds = list(dict.fromkeys(one.kind for one in found))
    rows = [_row(kind, [one for one in found if one.kind == kind]) for kind in kinds]
    rows.append(_row("all", found))
    rows += [
        {"kind": one.kind, "seed": one.seed, "robots": one.robots, "ending": one.ending}
        | {"said": one.said[:SAID]}
        for one in found
        if one.ending != "planned"
    ]
    return rows


def _row(kind: str, found: list[Outcome]) -> Row:
    slacks = [one.slack for one in found if not math.isnan(one.slack)]
    seconds = [one.seconds for one in found]
    counts = {name: sum(one.ending == name for one in found) for name in ENDINGS}
    return {
        "kind": kind,
        "scenarios": len(found),
        "robots": sum(one.robots for one in found),
        **counts,
        "least slack mm": 1000.0 * min(slacks, default=math.inf),
        "median s": median(seconds),
        "longest s": max(seconds),
        "in all s": sum(seconds),
    }


def main() -> None:
    """Run the campaign that the command line names."""
    chosen = options(__doc__, COUNT, DEFAULT_EFFORT)
    rows = safety(chosen.count, chosen.from_seed, chosen.effort, chosen.jobs, chosen.kept)
    record("safety", {f"{chosen.count} scenarios from seed {chosen.from_seed}": rows})


if __name__ == "__main__":
    main()
