"""The proof of a plan document: from the file alone, or against a scenario.

Decides: what a document is proven against.  The proof itself is proof.py.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from coordinator.budget import budget_for, resolve_tau
from coordinator.floor import Floor
from coordinator.plan import Limits, PlanDocument, Proof
from coordinator.proof import TOLERANCE, prove
from coordinator.scenario import Robot, Scenario
from coordinator.wire import Driven, drive

_STEP: Final = 5e-4
_HEADING: Final = 1e-2
"""Sampling of the path [m] when looking for via points, and how far [rad] a heading may be off."""


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
        failures += _misses(one, robot)
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


def _misses(driven: Driven, robot: Robot) -> list[str]:
    """Return which of the places and headings that a scenario asks for a path does not have."""
    curve = driven.curve
    u = curve.parameter_at(np.linspace(0.0, curve.length, 2 + int(curve.length / _STEP)))
    points, first = curve.derivatives(u, 1)
    failures = []
    for name, index, pose in (("start", 0, robot.start), ("goal", -1, robot.goal)):
        if np.hypot(*(points[index] - pose[:2])) > TOLERANCE:
            failures.append(f"{driven.id}'s {name} is not the scenario's")
        if len(pose) == 3:
            along = first[index] / np.hypot(*first[index])
            if along @ (math.cos(pose[2]), math.sin(pose[2])) < math.cos(_HEADING):
                failures.append(f"{driven.id}'s heading at its {name} is not the scenario's")
    failures += [
        f"{driven.id} does not pass ({place[0]}, {place[1]})"
        for place in robot.via
        if np.hypot(*(points - place).T).min() > TOLERANCE + _STEP
    ]
    return failures
