"""How well a fleet flows: delays over driving alone on the shortest ways, last arrivals, rests.

Decides: floors, sizes, and what plans are compared with.  "Before" is the same planner without ways
in space and time, which an effort below 5 leaves out.  ORCA (RVO2) drives the same scenes on the
shortest ways without a plan; it is left out where the peers' interpreter is missing.  No fleet can
be earlier than robots alone.
"""

from __future__ import annotations

import json
import math
import statistics
import subprocess
import time
from collections.abc import Sequence
from typing import Final

import numpy as np
from msgspec.structs import replace

from benchmarks.alone import finish_on, rests
from benchmarks.table import ROOT, Row
from coordinator.base.errors import PlanError
from coordinator.curves.nurbs import Nurbs
from coordinator.paths.path_planner import Pathfinder, find_paths
from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import DEFAULT_EFFORT, plan_scenario
from coordinator.scenario.model import Robot, Scenario, Workspace
from sim.floors.generator import generate

_FLOORS: Final = ("open", "warehouse", "cross-town", "rooms")
_SIZES: Final = (20, 50, 100, 300)
_TAUS: Final = ("auto", 0.5)
_BEFORE: Final = 4

_CIRCLES: Final = (8, 12, 16, 24, 32, 64)
_SPACING: Final = 1.0
"""Robots of circles, and the distance of neighbours [m]."""

_PEERS: Final = ROOT / ".venv-peers" / "bin" / "python"
_ORCA: Final = ROOT / "benchmarks" / "peers" / "orca.py"
_PATIENCE: Final = 5.0
"""ORCA's robots have so many times as long as the slowest one alone."""


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
                        **_by_orca(scenario, paths, alone),
                        "slowest alone s": max(alone),
                    }
                )
    return rows


def circles() -> list[Row]:
    """Return a row per circle: equal discs that all go to the opposite place, as dense as can be.

    By hand all drive the same way round, with tau and the need between them.
    """
    rows: list[Row] = []
    for count in _CIRCLES:
        scenario = circle(count)
        begun = time.perf_counter()
        plan = plan_scenario(scenario)
        took = time.perf_counter() - begun
        one = scenario.robots[0]
        need = 2.0 * one.radius + scenario.margin
        pace = min(scenario.planned_speed(one), (_SPACING - need) / plan.tau)
        finish = [robot.finish_time for robot in plan.robots]
        rows.append(
            {
                "robots": count,
                "by hand s": 0.5 * count * _SPACING / pace + pace / one.max_accel,
                "last s": max(finish),
                "mean s": statistics.mean(finish),
                "took s": took,
            }
        )
    return rows


def circle(count: int) -> Scenario:
    """Return discs on a circle, their neighbours _SPACING [m] apart along it."""
    radius = count * _SPACING / (2.0 * math.pi)
    middle = 1.6 * radius + 2.0
    robots = []
    for index in range(count):
        angle = 2.0 * math.pi * index / count
        x, y = radius * math.cos(angle), radius * math.sin(angle)
        robots.append(
            Robot(
                id=f"R{index + 1}",
                start=(middle + x, middle + y),
                goal=(middle - x, middle - y),
                radius=0.2,
                max_speed=0.8,
                max_accel=0.8,
                max_lateral_accel=0.8,
            )
        )
    side = 2.0 * middle
    corners = ((0.0, 0.0), (side, 0.0), (side, side), (0.0, side))
    floor = Workspace(boundary=corners, obstacles=())
    return Scenario(name=f"circle-{count}", workspace=floor, robots=tuple(robots))


def _by_orca(scenario: Scenario, paths: Sequence[Nurbs], alone: list[float]) -> Row:
    """Return what ORCA makes of a scene: delay of those that arrive, how many do not, or touch."""
    if not _PEERS.exists():
        return {}
    agents = [
        {
            "radius": robot.radius,
            "speed": scenario.planned_speed(robot),
            "way": path.at_arc(np.linspace(0.0, path.length, 2 + int(path.length / 0.5))).tolist(),
        }
        for robot, path in zip(scenario.robots, paths, strict=True)
    ]
    floor = scenario.workspace
    rings = [_turned(floor.boundary, -1.0), *(_turned(ring, 1.0) for ring in floor.obstacles)]
    job = {"agents": agents, "rings": rings, "seconds": _PATIENCE * max(alone)}
    command = [str(_PEERS), str(_ORCA)]
    done = subprocess.run(
        command, input=json.dumps(job), capture_output=True, text=True, check=True
    )
    found = json.loads(done.stdout)
    late = [t - free for t, free in zip(found["arrivals"], alone, strict=True) if t is not None]
    return {
        "ORCA delay s": statistics.mean(late) if late else math.nan,
        "ORCA last s": max((t for t in found["arrivals"] if t is not None), default=math.nan),
        "ORCA stuck": len(alone) - len(late),
        "ORCA touched": found["touched"],
    }


def _turned(corners: Sequence[tuple[float, float]], wanted: float) -> list[tuple[float, float]]:
    """Return a ring's corners counter-clockwise (wanted 1) or clockwise (-1)."""
    x, y = np.array(corners).T
    area = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return list(corners) if area * wanted > 0.0 else list(corners)[::-1]


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
