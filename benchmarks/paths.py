"""The path stage: shortest ways compared with other libraries (peers), growth, whole fleets.

Decides: what is compared, and the targets.  Nothing asserts a time.
"""

from __future__ import annotations

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from statistics import median
from typing import Final

from msgspec.structs import replace

from benchmarks.floors import CORNERS, Arena, arena
from benchmarks.growth_figure import Curve, draw
from benchmarks.table import ROOT, Row
from benchmarks.ways import LIMIT, Measured, measure_ours, measure_peer
from coordinator.curves.nurbs import Nurbs
from coordinator.ground.grown_floor import GrownFloor
from coordinator.motion.velocity_profile import Motion, limits_on
from coordinator.paths.path_planner import Pathfinder, find_paths
from coordinator.plan.drafting import draft_plan
from coordinator.plan.wire import Driven, packed
from coordinator.proof.tau_safety import least_clearance
from coordinator.scenario.model import Scenario
from sim.floors.generator import generate
from sim.floors.layout import Kind

OURS: Final = "splinefleet"
PEERS: Final = ("extremitypathfinder", "pyvisgraph")
POINT: Final = 1e-3
"""Reach [m] in the comparison: the peers plan for points."""
ROBOT: Final = 0.3
"""Reach [m] of a robot and its margin."""
ROUNDS: Final = 3
THREADS: Final = 2
ENOUGH: Final = 20.0
"""After a round that took longer than this [s] no further one is run."""
PER_TURN: Final = 2e-3
RELATIVE: Final = 1e-3
"""Lengths agree within this [m] per turn of ours, or within this share."""
TARGETS: Final = {
    (500, "peers"): "prepare / ours >= 50, query / ours >= 10",
    (2_000, OURS): "prepare < 100 ms, query < 5 ms",
}


def against_peers() -> list[Row]:
    """Measure every library on every floor, and draw how times grow with corners."""
    rows: list[Row] = []
    curves: dict[str, Curve] = {name: [] for name in (OURS, *PEERS)}
    for corners in CORNERS:
        floor = arena(corners)
        slow = {peer: _forecast(curves[peer], corners) for peer in PEERS}
        measured = _in_turn(floor, [peer for peer in PEERS if slow[peer] <= LIMIT])
        for name, curve in curves.items():
            if name in measured:
                found = measured[name]
                curve.append((corners, median(found.prepare), median(found.queries)))
                rows.append(_row(name, floor, measured))
            else:
                rows.append(_left_out(name, corners, slow[name]))
    draw(curves, ROOT / "docs" / "img" / "growth.png")
    return rows


def for_robots() -> list[Row]:
    """Measure our library on the same floors for a robot, for which corners are rounded."""
    rows: list[Row] = []
    for corners in CORNERS:
        floor = arena(corners)
        for reach in (POINT, ROBOT):
            found = measure_ours(floor, reach)
            rows.append(
                {
                    "corners": corners,
                    "reach m": reach,
                    "prepare ms": 1e3 * median(found.prepare),
                    "first query ms": 1e3 * median(found.first),
                    "query ms": 1e3 * median(found.queries),
                    "slowest ms": 1e3 * max(found.queries),
                    "repeated query ms": 1e3 * median(found.again),
                    "no way": found.lengths.count(None),
                }
            )
    return rows


def fleets() -> list[Row]:
    """Find the paths of whole fleets and prove their clearance."""
    _find(generate("warehouse", 5, seed=1))  # loads the compiled code
    return [_fleet(scene) for scene in SCENES]


@dataclass(frozen=True)
class Scene:
    """A generated floor with its robots; `target` [s] is for all of its robots together."""

    kind: Kind
    robots: int
    target: float
    obstacles: int | None = None


SCENES: Final = (
    Scene("warehouse", 100, 0.3),
    Scene("polygons", 1_000, 3.0, obstacles=67),
)
"""The 17-robot floor of the paper's Fig. 4 scaled up; about 500 corners, most of them separate."""


def _in_turn(floor: Arena, peers: list[str]) -> dict[str, Measured]:
    """Measure our library and the peers round by round; a peer that was stopped is left out."""
    measured: dict[str, Measured] = {}
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        for name in (OURS, *peers):
            found = measure_ours(floor, POINT) if name == OURS else measure_peer(name, floor)
            if found is not None:
                measured.setdefault(name, Measured()).add(found)
        if time.perf_counter() - begin > ENOUGH:
            break
    return measured


def _forecast(curve: Curve, corners: int) -> float:
    """Return the preparation time [s] to expect if it grows with the square of the corners."""
    if not curve:
        return 0.0
    before, prepare, _ = curve[-1]
    return prepare * (corners / before) ** 2


def _row(name: str, floor: Arena, measured: dict[str, Measured]) -> Row:
    found, ours = measured[name], measured[OURS]
    prepare, query = median(found.prepare), median(found.queries)
    return {
        "corners": floor.corners,
        "library": name,
        "prepare ms": 1e3 * prepare,
        "first query ms": 1e3 * median(found.first),
        "query ms": 1e3 * query,
        "prepare / ours": prepare / median(ours.prepare),
        "query / ours": query / median(ours.queries),
        "first answer / ours": found.ready / ours.ready,
        "queries": len(found.lengths),
        "disagree": _disagreements(found, measured),
        "target": TARGETS.get((floor.corners, name if name == OURS else "peers"), ""),
    }


def _left_out(name: str, corners: int, seconds: float) -> Row:
    why = (
        f"left out: would prepare for about {seconds / 60.0:.0f} min"
        if seconds > LIMIT
        else f"stopped after {2.0 * LIMIT / 60.0:.0f} min"
    )
    return {"corners": corners, "library": name, "target": why}


def _disagreements(found: Measured, measured: dict[str, Measured]) -> int:
    """Count the ways that are longer than the shortest one that any library found."""
    count = 0
    for number, length in enumerate(found.lengths):
        known = [one.lengths[number] for one in measured.values() if number < len(one.lengths)]
        best = min((one for one in known if one is not None), default=None)
        if best is None:
            continue
        allowed = max(PER_TURN * measured[OURS].turns[number], RELATIVE * best)
        count += length is None or length - best > allowed
    return count


def _fleet(scene: Scene) -> Row:
    """Measure one fleet: medians of a few runs, each on a fresh floor."""
    scenario = generate(scene.kind, scene.robots, seed=1, obstacles=scene.obstacles)
    spent: list[float] = []
    while len(spent) < ROUNDS and sum(spent) <= ENOUGH:
        paths, seconds = _find(scenario)
        spent.append(seconds)
    driven = _drive(scenario, paths)
    proofs = [_clearance(scenario, driven) for _ in range(ROUNDS)]
    found, proven = median(spent), median(seconds for seconds, _ in proofs)
    return {
        "floor": scene.kind,
        "robots": scene.robots,
        "corners": sum(len(ring) for ring in scenario.workspace.obstacles),
        "paths s": found,
        "clearance s": proven,
        "total s": found + proven,
        "ms a robot": 1e3 * (found + proven) / scene.robots,
        "target s": scene.target,
        "least clearance less margin mm": 1e3 * (proofs[0][1] - scenario.margin),
    }


def _find(scenario: Scenario) -> tuple[list[Nurbs], float]:
    """Return all paths and the time [s] that finding them took."""
    with ThreadPoolExecutor(THREADS) as executor:
        begin = time.perf_counter()
        paths = find_paths(Pathfinder(scenario), executor)
        return paths, time.perf_counter() - begin


def _drive(scenario: Scenario, paths: list[Nurbs]) -> list[Driven]:
    """Return the motions that robots decode from their bytes, each planned as if alone."""
    driven = []
    for robot, path in zip(scenario.robots, paths, strict=True):
        speed = scenario.planned_speed(robot)
        motion = Motion(
            limits_on(path, speed, robot.max_accel, robot.max_lateral_accel, robot.max_turn_rate),
            [],
        )
        alone = replace(scenario, robots=(robot,))
        driven += packed(draft_plan(alone, [path], [motion], tau=1.0, epoch=1, notes=[])).driven
    return driven


def _clearance(scenario: Scenario, driven: list[Driven]) -> tuple[float, float]:
    """Return the time [s] that the proof of clearance takes, and the least clearance [m]."""
    begin = time.perf_counter()
    floor = GrownFloor(scenario.workspace.boundary, scenario.workspace.obstacles)
    least = least_clearance(driven, floor.gap)[0]
    return time.perf_counter() - begin, least
