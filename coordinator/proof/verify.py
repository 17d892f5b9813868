"""The proof of a plan document: from the file alone, or against a scenario.

Decides: the floor, limits and terms that a plan is proven against.  The proof itself is in
tau_safety.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from concurrent.futures import Executor
from typing import Final

import numpy as np
from msgspec.structs import replace

from coordinator.base.errors import PartsError
from coordinator.curves.nurbs import Array
from coordinator.plan.checks import LENGTH_TOLERANCE, LONGEST_PLAN
from coordinator.plan.document import Limits, PlanDocument, Proof, RobotPlan
from coordinator.plan.shares_of_tau import resolve_tau, shares_of
from coordinator.plan.wire import Driven, PackedPlan, packed
from coordinator.proof.motion_pieces import Flights
from coordinator.proof.precedence import staircase_failures
from coordinator.proof.tau_safety import prove
from coordinator.scenario.floor import Floor
from coordinator.scenario.margin import TOLERANCE
from coordinator.scenario.model import Robot, Scenario

_HEADING: Final = 1e-2
"""How far [rad] a heading may differ from the scenario's."""

_TIME_TOLERANCE: Final = 1e-2
"""How far [s] a time in the file may differ from the time that follows from the wire bytes."""

_SAME: Final = 1e-9
"""Values of tau [s] or margin [m] that differ by no more than this count as equal."""

_RESERVED: Final = 1.0001
"""Factor by which a planned speed may exceed the speed that `speed_reserve` leaves."""

_LIMITS: Final = (
    ("max_speed", "m/s"),
    ("max_accel", "m/s^2"),
    ("max_lateral_accel", "m/s^2"),
    ("min_turn_radius", "m"),
    ("max_turn_rate", "rad/s"),
)

_PLAN_ROUNDING: Final = 1.0
"""How much [s] a plan may last longer on the wire than LONGEST_PLAN, because of rounding."""


def prove_document(document: PlanDocument, scenario: Scenario | None = None) -> Proof:
    """Pack a document's messages and prove the plan from them.

    Raises PartsError as `prove_messages` does, and when no message can be made for a robot.
    """
    return prove_messages(packed(document), scenario)


def prove_messages(
    plan: PackedPlan, scenario: Scenario | None = None, executor: Executor | None = None
) -> Proof:
    """Prove a plan from its wire bytes, and its staircases if it has any.

    The executor proves the staircases of large fleets in parts.

    With a scenario, the plan is proven against the scenario's floor, limits, tau and margin.  The
    proof then also fails if the document's tau, margin, link or limits differ from the scenario's,
    since the messages are made from the document, or if a radius is smaller.  Without a scenario,
    the values in the document are used.  Raises PartsError when a robot would not accept its
    message, or would drive too long.
    """
    document, driven = plan.document, plan.driven
    _check_durations(driven)
    told = [
        failure
        for robot, one in zip(document.robots, driven, strict=True)
        for failure in _disagreements(robot, one)
    ]
    if scenario is not None:
        proof = _prove_against(document, driven, scenario)
    else:
        proof = _prove_alone(document, driven)
    if plan.staircases is not None:
        told += staircase_failures(
            Flights(driven), plan.staircases, document.margin, executor=executor
        )
    return _with_failures(proof, told)


def _check_durations(driven: list[Driven]) -> None:
    """Raise PartsError for motions so long that the proof would run out of memory."""
    problems = {
        one.id: f"plan: robots[{one.id}]: lasts {one.timeline.finish:g} s on the wire, "
        f"must be at most {LONGEST_PLAN:g} s"
        for one in driven
        if not one.timeline.finish <= LONGEST_PLAN + _PLAN_ROUNDING
    }
    if problems:
        raise PartsError(list(problems.values()), list(problems))


def _disagreements(robot: RobotPlan, driven: Driven) -> list[str]:
    """Return a sentence for each value of the file that differs from the wire bytes."""
    line = driven.timeline
    arrivals = line.arrivals[1:] if robot.start_time > 0.0 else line.arrivals
    pairs = [
        ("length", robot.length, line.length, "m", LENGTH_TOLERANCE),
        ("finish_time", robot.finish_time, line.finish, "s", _TIME_TOLERANCE),
    ]
    pairs += [
        (f"stops[{i}].arrive", stop.arrive, arrival, "s", _TIME_TOLERANCE)
        for i, (stop, arrival) in enumerate(zip(robot.stops, arrivals, strict=True))
    ]
    return [
        f"{robot.id}'s {name} is {said:.6g} {unit} in the file, {found:.6g} {unit} on the wire"
        for name, said, found, unit, tolerance in pairs
        if not abs(said - found) <= tolerance
    ]


def _with_failures(proof: Proof, failures: list[str]) -> Proof:
    """Return the proof with these failures before its own; a proof with failures does not hold."""
    if not failures:
        return proof
    return replace(proof, holds=False, survives=[], failures=failures + proof.failures)


def _prove_alone(document: PlanDocument, driven: list[Driven]) -> Proof:
    floor = document.workspace
    known = [robot.limits for robot in document.robots if robot.limits is not None]
    all_known = len(known) == len(document.robots)
    proof = prove(
        driven,
        document.tau,
        document.margin,
        None if floor is None else Floor(floor.boundary, floor.obstacles).gap,
        [robot.limits for robot in document.robots],
    )
    missing = {"clearance": floor is None, "limits": not all_known}
    return replace(proof, unproven=[name for name, absent in missing.items() if absent])


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
        failures += _hurries(one, scenario.planned_speed(robot))
    planned = {one.id for one in driven}
    failures += [f"{name} has no plan" for name in robots if name not in planned]
    limits = [Limits.of(robot) for robot in scenario.robots]
    tau, margin = resolve_tau(scenario.tau, shares_of(limits, scenario.link)), scenario.margin
    failures += _other_terms(document, scenario, tau)
    floor = Floor(scenario.workspace.boundary, scenario.workspace.obstacles)
    known = [Limits.of(robots[d.id]) if d.id in robots else None for d in driven]
    proof = prove(driven, tau, margin, floor.gap, known)
    return _with_failures(proof, failures)


def _other_terms(document: PlanDocument, scenario: Scenario, tau: float) -> list[str]:
    """Return which terms of a plan are not the scenario's; tau [s] is what the scenario asks for.

    Robots act on these terms: the margin bounds how far off their paths they may be, the link how
    far ahead they are let, and max_accel how they brake.  A larger min_turn_radius than the
    scenario's is accepted.
    """
    asked = [
        (name, getattr(document, name), value, unit)
        for name, value, unit in (("tau", tau, " s"), ("margin", scenario.margin, " m"))
    ]
    failures = [
        f"the plan's {name} is {said:.9g}{unit}, the scenario asks for {value:.9g}{unit}"
        for name, said, value, unit in asked
        if abs(said - value) > _SAME
    ]
    failures += [
        f"the plan's link.{name} is {said:g}{unit}, the scenario's is {value:g}{unit}"
        for name, unit in (("delay", " s"), ("loss", ""))
        if (said := getattr(document.link, name)) != (value := getattr(scenario.link, name))
    ]
    known = {robot.id: Limits.of(robot) for robot in scenario.robots}
    for robot in document.robots:
        if robot.id in known:
            failures += _other_limits(robot, known[robot.id])
    return failures


def _other_limits(robot: RobotPlan, limits: Limits) -> Iterator[str]:
    """Yield a sentence for each limit in a robot's plan that differs from the scenario's."""
    if robot.limits is None:
        if limits.max_accel is not None:
            yield _other_limit(robot, "max_accel", None, limits.max_accel, "m/s^2")
        return
    for name, unit in _LIMITS:
        said, value = getattr(robot.limits, name), getattr(limits, name)
        if said != value and not (name == "min_turn_radius" and said > value):
            yield _other_limit(robot, name, said, value, unit)


def _other_limit(
    robot: RobotPlan, name: str, said: float | None, value: float | None, unit: str
) -> str:
    told, asked = ("none" if one is None else f"{one:g} {unit}" for one in (said, value))
    return f"{robot.id}'s limits.{name} is {told}, the scenario's is {asked}"


def _hurries(driven: Driven, fastest: float) -> Iterator[str]:
    """Yield a sentence if a robot's planned speed exceeds `fastest` [m/s], so has less reserve."""
    most = max(driven.timeline.v0 + driven.timeline.v1)
    if most > fastest * _RESERVED:
        yield (
            f"{driven.id} is planned at up to {most:.6g} m/s, {fastest:.6g} m/s are left by "
            "speed_reserve"
        )


def _misses(driven: Driven, robot: Robot) -> list[str]:
    """Return a sentence for each place or heading asked for by the scenario that a path misses."""
    points, first = driven.curve.derivatives([0.0, driven.curve.knots[-1]], 1)
    failures = []
    for name, index, pose in (("start", 0, robot.start), ("goal", -1, robot.goal)):
        if np.hypot(*(points[index] - pose[:2])) > TOLERANCE:
            failures.append(f"{driven.id}'s {name} is not the scenario's")
        # The path of an idle robot is too short for float32 to give it a direction exactly.
        if len(pose) == 3 and not robot.is_idle:
            along = first[index] / np.hypot(*first[index])
            if along @ (math.cos(pose[2]), math.sin(pose[2])) < math.cos(_HEADING):
                failures.append(f"{driven.id}'s heading at its {name} is not the scenario's")
    failures += [
        f"{driven.id} does not pass ({place[0]:g}, {place[1]:g})"
        for place in robot.via
        if _distance(np.array(place), driven.chain.points) > TOLERANCE + driven.chain.bound
    ]
    return failures


def _distance(place: Array, line: Array) -> float:
    """Return the distance [m] of a place (2,) from a polyline (n, 2)."""
    begin, way = line[:-1], np.diff(line, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-300)
    part = np.clip(np.einsum("ij,ij->i", place - begin, way) / square, 0.0, 1.0)
    return float(np.hypot(*(begin + part[:, None] * way - place).T).min())
