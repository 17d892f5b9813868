"""Our waits compared with the paper's: Algorithm 2 with a T just large enough to be safe.

Decides: how that T is searched for.  A plan may be safe for some T and not for a larger one, so
steps of `STEP` are tried in turn, and the first one that is safe is refined by bisection.  Must not
know: how plans are made.
"""

from __future__ import annotations

from functools import partial
from typing import Final

from msgspec.structs import replace

from benchmarks.alone import alone, rests
from benchmarks.table import ROOT, Row
from coordinator.base.errors import PlanError
from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import read_scenario

STEP: Final = 0.5
MOST: Final = 30.0
SHARP: Final = 0.01
"""The step and the end of the search for T, and the precision with which T is then found [s]."""


def against_paper() -> list[Row]:
    """Return delays, rests and last arrivals of both policies for all examples."""
    rows: list[Row] = []
    for path in sorted((ROOT / "examples").glob("*.toml")):
        scenario = read_scenario(path)
        rows.append(_row(path.stem, "safe", scenario, plan_scenario(scenario)))
        stop_time, safe = least_stop_time(scenario)
        if safe is None:
            rows.append(_hopeless(path.stem, scenario))
        else:
            rows.append(_row(path.stem, "paper", scenario, safe) | {"T s": stop_time})
    return rows


def least_stop_time(scenario: Scenario) -> tuple[float, PlanDocument | None]:
    """Return the least T [s] for which the paper's plan is proven, with the plan, or None."""
    plan = partial(_paper, scenario)
    steps = round(MOST / STEP)
    for number in range(steps + 1):
        found = plan(number * STEP)
        if found is None:
            continue
        low, high = (number - 1) * STEP, number * STEP
        while number and high - low > SHARP:
            middle = 0.5 * (low + high)
            better = plan(middle)
            low, high = (low, middle) if better else (middle, high)
            found = better or found
        return high, found
    return MOST, None


def _paper(scenario: Scenario, stop_time: float) -> PlanDocument | None:
    """Return the paper's plan for T [s]; None when it is not safe."""
    try:
        document = plan_scenario(replace(scenario, policy="paper", stop_time=stop_time))
    except PlanError:
        return None
    return document if document.proof and document.proof.holds else None


def _hopeless(name: str, scenario: Scenario) -> Row:
    return {
        "scenario": name,
        "policy": "paper",
        "robots": len(scenario.robots),
        "note": f"not safe for any T up to {MOST:g} s",
    }


def _row(name: str, policy: str, scenario: Scenario, document: PlanDocument) -> Row:
    finish = [robot.finish_time for robot in document.robots]
    free = alone(document, scenario)
    return {
        "scenario": name,
        "policy": policy,
        "robots": len(finish),
        "sum of delays s": sum(finish) - sum(free),
        "longest delay s": max(late - early for late, early in zip(finish, free, strict=True)),
        "rests": rests(document),
        "last arrival s": max(finish),
        "slowest alone s": max(free),
    }
