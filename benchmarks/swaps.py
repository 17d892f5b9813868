"""Crowded scenes: rings of robots and swaps across a circle, compared with other planners (peers).

Decides: the scenes, and the peers' figures to compare.  The generator makes the curves; speeds are
such that the slowest robot alone takes as long as in the peers' scene, if that time is known.  Must
not know: how plans are made.
"""

from __future__ import annotations

import time
from typing import Final, NamedTuple

from msgspec.structs import replace

from benchmarks.alone import alone, finish_on, rests
from benchmarks.table import Row
from coordinator.base.errors import PlanError
from coordinator.paths.path_planner import Pathfinder
from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import DEFAULT_EFFORT, plan_scenario
from coordinator.scenario.model import Robot, Scenario
from sim.floors.generator import generate
from sim.floors.layout import Kind

SEED: Final = 1
TAU: Final = 0.5
RING: Final = (136.0, 136.0)
"""The floor [m] of all rings: the smallest with room for 200 robots, so only the density grows."""


class Scene(NamedTuple):
    """A scene; `ideal` [s]: the time of the slowest robot alone in the peers' scene, 0: unknown."""

    kind: Kind
    robots: int
    ideal: float = 0.0
    peers: str = ""


SCENES: Final = (
    Scene("ring", 50, 131.0, "coordination_oru 177.7 s, reference 166.9 s"),
    Scene("ring", 100, 134.0, "coordination_oru 326.4 s, reference 169.3 s"),
    Scene("ring", 200, 134.0, "reference 231.8 s"),
    Scene("circle", 5),
    Scene("circle", 6),
    Scene("circle", 17, 20.5, "ORCA with noise 41.7 s, coordination_oru 60.2 s"),
    Scene("circle", 50),
    Scene("circle", 100),
)
"""The peers' figures are quoted, as in docs/schedule.md."""


def swaps(effort: int = DEFAULT_EFFORT) -> list[Row]:
    """Plan all scenes; return last arrivals, those of the slowest robot alone, and of peers."""
    return [_row(scene, effort) for scene in SCENES]


def make(scene: Scene) -> Scenario:
    """Return the scenario; if there is an ideal time, all speeds are scaled to it."""
    size = RING if scene.kind == "ring" else None
    made = replace(generate(scene.kind, scene.robots, SEED, size), tau=TAU)
    if not scene.ideal:
        return made
    finder = Pathfinder(made)
    free = [finish_on(finder.path(i), robot, made) for i, robot in enumerate(made.robots)]
    faster = max(free) / scene.ideal
    return replace(made, robots=tuple(_scaled(robot, faster) for robot in made.robots))


def _scaled(robot: Robot, faster: float) -> Robot:
    """Return the robot with limits such that it drives every path faster by this factor."""
    return replace(
        robot,
        max_speed=robot.max_speed * faster,
        max_accel=robot.max_accel * faster**2,
        max_lateral_accel=robot.max_lateral_accel * faster**2,
    )


def _row(scene: Scene, effort: int) -> Row:
    scenario = make(scene)
    begin = time.perf_counter()
    try:
        document = plan_scenario(scenario, effort=effort)
    except PlanError as error:
        return {"scene": scene.kind, "robots": scene.robots, "peers": f"no plan: {error}"}
    seconds = time.perf_counter() - begin
    return _measured(scene, scenario, document) | {"plan s": seconds, "peers": scene.peers}


def _measured(scene: Scene, scenario: Scenario, document: PlanDocument) -> Row:
    finish = [robot.finish_time for robot in document.robots]
    free = alone(document, scenario)
    return {
        "scene": scene.kind,
        "robots": scene.robots,
        "last arrival s": max(finish),
        "slowest alone s": max(free),
        "ratio": max(finish) / max(free),
        "mean delay s": (sum(finish) - sum(free)) / len(finish),
        "rests": rests(document),
        "proof holds": str(document.proof is not None and document.proof.holds),
    }
