"""How well a fleet flows: delays over driving alone on the shortest ways, last arrivals, rests.

Decides: floors, sizes, and what plans are compared with.  "Before" is the same planner without ways
in space and time, which an effort below 5 leaves out.
"""

from __future__ import annotations

import statistics
import time
from typing import Final

from msgspec.structs import replace

from benchmarks.alone import finish_on, rests
from benchmarks.table import Row
from coordinator.base.errors import PlanError
from coordinator.paths.path_planner import Pathfinder, find_paths
from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import DEFAULT_EFFORT, plan_scenario
from coordinator.scenario.model import Scenario
from sim.floors.generator import generate

_FLOORS: Final = ("open", "warehouse", "cross-town", "rooms")
_SIZES: Final = (20, 50, 100, 300)
_TAUS: Final = ("auto", 0.5)
_BEFORE: Final = 4


def flow(sizes: tuple[int, ...] = _SIZES) -> list[Row]:
    """Return a row per floor, number of robots and tau."""
    rows: list[Row] = []
    for kind in _FLOORS:
        for count in sizes:
            for tau in _TAUS:
                scenario = replace(generate(kind, count, 1), tau=tau)
                paths = find_paths(Pathfinder(scenario))
                alone = [
                    finish_on(path, robot, scenario)
                    for path, robot in zip(paths, scenario.robots, strict=True)
                ]
                rows.append(
                    {
                        "floor": kind,
                        "robots": count,
                        "tau": str(tau),
                        "alone s": statistics.mean(alone),
                        **_measured(scenario, alone, _BEFORE, "before"),
                        **_measured(scenario, alone, DEFAULT_EFFORT, "now"),
                        "slowest alone s": max(alone),
                    }
                )
    return rows


def _measured(scenario: Scenario, alone: list[float], effort: int, name: str) -> Row:
    """Return delay, last arrival and rests a robot of a plan, and how long planning took."""
    begun = time.perf_counter()
    try:
        plan: PlanDocument = plan_scenario(scenario, effort=effort)
    except PlanError:
        return {f"{name} delay s": "refused"}
    took = time.perf_counter() - begun
    finish = [robot.finish_time for robot in plan.robots]
    return {
        f"{name} delay s": statistics.mean(finish) - statistics.mean(alone),
        f"{name} last s": max(finish),
        f"{name} rests": rests(plan) / len(finish),
        f"{name} took s": took,
    }
