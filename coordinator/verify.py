"""The proof of a plan document: from the file alone, or against a scenario.

Decides: what a document is proven against.  The proof itself is proof.py.
"""

from __future__ import annotations

import numpy as np

from coordinator.budget import budget_for, resolve_tau
from coordinator.floor import Floor
from coordinator.plan import Limits, PlanDocument, Proof
from coordinator.proof import TOLERANCE, prove
from coordinator.scenario import Scenario
from coordinator.wire import Driven, drive


def prove_document(document: PlanDocument, scenario: Scenario | None = None) -> Proof:
    """Prove a document from its wire bytes.

    With a scenario its floor, limits, radii, tau and margin count, not what the document says of
    them.  Raises InputError when a robot would not accept its message.
    """
    driven = drive(document)
    if scenario is not None:
        return _prove_against(document, driven, scenario)
    floor = document.workspace
    known = [robot.limits for robot in document.robots if robot.limits is not None]
    return prove(
        driven,
        document.tau,
        document.margin,
        None if floor is None else Floor(floor.boundary, floor.obstacles).distance,
        [robot.limits for robot in document.robots],
        budget_for(known) if len(known) == len(document.robots) else None,
    )


def _prove_against(document: PlanDocument, driven: list[Driven], scenario: Scenario) -> Proof:
    robots = {robot.id: robot for robot in scenario.robots}
    failures = []
    for one in driven:
        robot = robots.get(one.id)
        if robot is None:
            failures.append(f"{one.id} is not in the scenario")
            continue
        if one.radius < robot.radius:
            failures.append(f"{one.id} is planned with radius {one.radius} m, has {robot.radius} m")
        ends = one.curve.at_arc([0.0, one.curve.length])
        for name, planned, wanted in (
            ("start", ends[0], robot.start),
            ("goal", ends[1], robot.goal),
        ):
            if np.hypot(*(planned - wanted[:2])) > TOLERANCE:
                failures.append(f"{one.id}'s {name} is not the scenario's")
    failures += [f"{name} has no plan" for name in robots if name not in {d.id for d in driven}]
    limits = [Limits.of(robot) for robot in scenario.robots]
    budget = budget_for(limits)
    tau, margin = resolve_tau(scenario.tau, budget), scenario.margin
    if document.tau < tau - 1e-9 or document.margin < margin - 1e-9:
        failures.append(
            f"planned for tau {document.tau} s and margin {document.margin} m, "
            f"the scenario asks for {tau} s and {margin} m"
        )
    floor = Floor(scenario.workspace.boundary, scenario.workspace.obstacles)
    known = [Limits.of(robots[d.id]) if d.id in robots else None for d in driven]
    proof = prove(driven, tau, margin, floor.distance, known, budget)
    if not failures:
        return proof
    return Proof(
        holds=False,
        pairs=proof.pairs,
        least_separation=proof.least_separation,
        least_clearance=proof.least_clearance,
        survives=[],
        tightest=proof.tightest,
        failures=failures + proof.failures,
    )
