"""Compile or load all kernels: `python -m coordinator.planning.warm`.

Compiling takes about a minute, once per machine and version; loading what was compiled takes a
fraction of a second, once per process.  Both happen here, not in the middle of a plan.

Decides: what is run to have every kernel compiled.  Must not know: results.
"""

from __future__ import annotations

import functools

from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Point, Pose, Robot, Scenario, Workspace


@functools.cache
def load_kernels() -> None:
    """Compile or load the kernels of planning, by planning for a floor that needs them all."""
    robots = (
        _robot("A", (1.0, 1.0), (9.0, 1.0)),
        _robot("B", (2.5, 6.8), (5.0, 6.8)),
        _robot("C", (6.0, 3.0), (9.0, 3.0)),
        _robot("D", (7.5, 1.5), (7.5, 4.5)),
    )
    walls = (((3.0, 0.0), (4.0, 0.0), (4.0, 6.0), (3.0, 6.0)),)
    plan_scenario(_scenario(robots, walls))


def compile_rest() -> None:
    """Compile the kernels that few plans need: headings, new times, maps."""
    import numpy as np

    from coordinator.curves.knots import insert_knot
    from coordinator.curves.nurbs import nurbs
    from coordinator.planning.retiming import retime
    from coordinator.scenario_files.maps.cells import outline_cells
    from coordinator.schedule.lateness import Lateness

    turning = _robot("E", (2.0, 3.0, 2.0), (8.0, 3.0, 2.0))
    crossing = _scenario((turning, _robot("F", (5.0, 1.0), (5.0, 5.0))), ())
    retime(crossing, plan_scenario(crossing), Lateness("F", 0.5, 1.0))
    insert_knot(nurbs(1, [0.0, 0.0, 1.0, 1.0], [[0.0, 0.0], [1.0, 0.0]]), 0.5)
    outline_cells(np.ones((2, 2), dtype=np.bool_), 1.0)


def _scenario(robots: tuple[Robot, ...], walls: tuple[tuple[Point, ...], ...]) -> Scenario:
    floor = Workspace(boundary=((0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0)), obstacles=walls)
    return Scenario(name="warm", workspace=floor, robots=robots, tau=0.5)


def _robot(name: str, start: Pose, goal: Pose) -> Robot:
    return Robot(
        id=name,
        start=start,
        goal=goal,
        radius=0.2,
        max_speed=0.8,
        max_accel=0.8,
        max_lateral_accel=0.8,
    )


if __name__ == "__main__":
    load_kernels()
    compile_rest()
