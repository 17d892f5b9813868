"""Planning whole scenes: the time of each stage.

Decides: which scenes.  Times are medians of three runs.
"""

from __future__ import annotations

import statistics
import time

from benchmarks.scenes import circle_swap
from benchmarks.table import ROOT, Row
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario


def planning() -> list[Row]:
    """Plan the examples and circles of robots that swap places; times per stage."""
    scenes = [read_scenario(path) for path in sorted((ROOT / "examples").glob("*.toml"))]
    scenes += [circle_swap(count) for count in (5, 8, 12, 17)]
    rows: list[Row] = []
    for scene in scenes:
        runs = [plan_scenario(scene, timer=time.perf_counter) for _ in range(3)]
        stages = {
            stage: statistics.median(run.timing[stage] for run in runs) for stage in runs[0].timing
        }
        finish = max(robot.finish_time for robot in runs[0].robots)
        rows.append(
            {
                "scene": scene.name,
                "robots": len(scene.robots),
                "last arrival s": finish,
                **{f"{stage} ms": 1000.0 * spent for stage, spent in stages.items()},
                "bytes a robot": statistics.mean(r.wire_bytes for r in runs[0].robots),
            }
        )
    return rows
