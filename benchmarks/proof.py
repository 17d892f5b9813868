"""The proof stage: times to decode and to prove plans, their growth, and the proof's precision.

Decides: which plans.  Times are the least of a few runs.  The robots of unscheduled fleets ("in a
row") leave one after the other; "kept apart" is such a fleet without the robots that come too near
to another one.  Nothing asserts a time.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from msgspec.structs import replace

from benchmarks.table import Row
from coordinator.base.errors import PlanError
from coordinator.motion.velocity_profile import Motion, Wait, limits_on
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.document import Limits, PlanDocument, Proof
from coordinator.plan.drafting import draft_plan
from coordinator.plan.wire import Driven, drive
from coordinator.planning.planner import plan_scenario
from coordinator.proof.motion_pieces import Flights
from coordinator.proof.separation import Separation
from coordinator.proof.tau_safety import prove, prove_separation
from coordinator.scenario.floor import Floor
from coordinator.scenario.margin import TOLERANCE
from coordinator.scenario.model import Scenario
from sim.floors.generator import KINDS, generate
from sim.floors.layout import Kind
from tests.damages import damaged, judge

TAU: Final = 2.0
BETWEEN: Final = 2.0
"""Time [s] between departures in an unscheduled fleet."""
PLANNED: Final[tuple[tuple[Kind, int], ...]] = (("open", 5), ("open", 100), ("warehouse", 100))
ROWS: Final[tuple[tuple[Kind, int], ...]] = (
    ("cross-town", 125), ("cross-town", 250), ("cross-town", 500), ("cross-town", 1_000),
)  # fmt: skip
DAMAGES: Final = 12
"""How often each plan is damaged."""


@dataclass(frozen=True)
class Case:
    """A fleet with its plan: the documents whose robots are read back, in order."""

    name: str
    scenario: Scenario
    documents: list[PlanDocument]
    tau: float

    def drive(self) -> list[Driven]:
        """Return the motion that each robot decodes from its bytes."""
        return [one for document in self.documents for one in drive(document)]


def proving() -> list[Row]:
    """Prove planned fleets, and larger unscheduled ones, "in a row" and "kept apart"."""
    rows = [_measure(_planned(kind, robots)) for kind, robots in PLANNED]
    for kind, robots in ROWS:
        case = _in_a_row(kind, robots)
        rows += [_measure(case), _measure(_kept_apart(case))]
    return rows


def sharpness(plans: int = 33) -> list[Row]:
    """Damage plans at random and compare the proof with the dense sampler, by kind of damage."""
    counted: dict[str, Counter[str]] = {}
    for seed in range(plans):
        scenario = generate(tuple(KINDS)[seed % len(KINDS)], 5 + seed % 8, seed, mixed=seed % 2 > 0)
        try:
            document = plan_scenario(scenario)
        except PlanError:
            continue
        made = [damaged(document, number) for number in range(DAMAGES)]
        for one in [(document, "none"), *filter(None, made)]:
            judged = judge(*one)
            count = counted.setdefault(judged.damage, Counter())
            count["plans"] += 1
            count["refused"] += judged.refused
            count["agree"] += judged.agreed
            count["between 2 mm and what is accepted"] += judged.between
    return [{"damage": damage, **count} for damage, count in sorted(counted.items())]


def _planned(kind: Kind, robots: int) -> Case:
    scenario = generate(kind, robots, 1)
    document = plan_scenario(scenario, effort=0)
    return Case(f"{kind}, planned", scenario, [document], document.tau)


def _in_a_row(kind: Kind, robots: int) -> Case:
    """Return robots that leave one after the other."""
    scenario = generate(kind, robots, 1)
    finder, documents = Pathfinder(scenario), []
    for index, robot in enumerate(scenario.robots):
        path = finder.path(index)
        speed = scenario.planned_speed(robot)
        limits = limits_on(
            path, speed, robot.max_accel, robot.max_lateral_accel, robot.max_turn_rate
        )
        motion = Motion(limits, [Wait(0.0, BETWEEN * index, -1)] if index else [])
        alone = replace(scenario, robots=(robot,))
        documents.append(draft_plan(alone, [path], [motion], tau=TAU, epoch=1, notes=[]).document)
    return Case(f"{kind}, in a row", scenario, documents, TAU)


def _kept_apart(case: Case) -> Case:
    """Return the fleet without the robots that come too near to another one."""
    scenario, documents = case.scenario, case.documents
    while True:
        driven = [one for document in documents for one in drive(document)]
        keep = np.array([one.radius for one in driven]) + 0.5 * scenario.margin
        near = Separation(Flights(driven), TAU).below(keep, -TOLERANCE)
        times = Counter(index for one in near for index in (one.a, one.b))
        if not near:
            return Case(case.name.replace("in a row", "kept apart"), scenario, documents, TAU)
        worse = {max((one.a, one.b), key=lambda index: (times[index], index)) for one in near}
        kept = [index for index in range(len(driven)) if index not in worse]
        documents = [documents[index] for index in kept]
        scenario = replace(scenario, robots=tuple(scenario.robots[index] for index in kept))


def _measure(case: Case) -> Row:
    scenario, driven = case.scenario, case.drive()
    read = _least(case.drive)
    apart = _least(lambda: prove_separation(Flights(driven), case.tau, scenario.margin))
    proof = _prove(case, driven)
    whole = read + _least(lambda: _prove(case, driven))
    return {
        "fleet": case.name,
        "robots": len(driven),
        "pairs": proof.pairs,
        "read back ms": 1e3 * read,
        "separation ms": 1e3 * apart,
        "whole proof ms": 1e3 * whole,
        "ms a robot": 1e3 * whole / len(driven),
        "lasts s": max(one.timeline.finish for one in driven),
        "least slack m": proof.least_slack or 0.0,
        "holds": str(proof.holds),
    }


def _prove(case: Case, driven: list[Driven]) -> Proof:
    floor = Floor(case.scenario.workspace.boundary, case.scenario.workspace.obstacles)
    limits = [Limits.of(robot) for robot in case.scenario.robots]
    margin = case.scenario.margin
    return prove(driven, case.tau, margin, floor.gap, limits)


def _least(action: Callable[[], object], runs: int = 3) -> float:
    """Return the least time [s] of an action in a few runs."""
    spent = []
    for _ in range(runs):
        begin = time.perf_counter()
        action()
        spent.append(time.perf_counter() - begin)
    return min(spent)
