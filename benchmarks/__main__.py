# ruff: noqa: T201
"""All benchmarks: `python -m benchmarks`.  Prints tables and writes benchmarks/results/*.json.

Times are medians of several runs on this machine; what can be compared is compared with a peer in
the same run, as a ratio.  Nothing here asserts a time.
"""

from __future__ import annotations

import json
import platform
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy.interpolate import BSpline

from benchmarks.scenes import circle_swap
from coordinator.nurbs import nurbs
from coordinator.planner import plan_scenario
from coordinator.scenario_file import read_scenario
from coordinator.wire import drive
from protocol.curve import Curve
from protocol.plan_parts import unpack_plan
from robot_agent.agent import Agent

ROOT = Path(__file__).resolve().parents[1]
Row = dict[str, float | int | str]


def median_of(action: Callable[[], object], runs: int = 7) -> float:
    """Return the median time [s] of an action, after one run to warm up."""
    action()
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        action()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def curves() -> list[Row]:
    """Evaluate a rational cubic with 12 control points: ours, the robot's, and SciPy's BSpline."""
    random = np.random.default_rng(1)
    points, weights = random.uniform(0.0, 10.0, (12, 2)), random.uniform(0.5, 2.0, 12)
    knots = np.concatenate((np.zeros(4), np.arange(1.0, 9.0), np.full(4, 9.0)))
    curve = nurbs(3, knots, points, weights)
    robot = Curve(3, knots.tolist(), *points.T.tolist(), weights.tolist())
    lifted = BSpline(knots, np.column_stack((points * weights[:, None], weights)), 3)
    u = np.linspace(0.0, 9.0, 10_000)

    def scipy_evaluate() -> object:
        homogeneous = lifted(u)
        return homogeneous[:, :2] / homogeneous[:, 2:]

    def robot_evaluate() -> None:
        for value in u_list:
            robot.evaluate(value)

    u_list = u.tolist()
    peer = median_of(scipy_evaluate)
    rows: list[Row] = []
    for name, action in (
        ("SciPy BSpline, homogeneous", scipy_evaluate),
        ("coordinator.nurbs", lambda: curve.evaluate(u)),
        ("protocol.curve (pure Python)", robot_evaluate),
    ):
        spent = median_of(action)
        rows.append(
            {"what": name, "us per point": 1e6 * spent / len(u), "times SciPy": spent / peer}
        )
    return rows


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


def agent() -> list[Row]:
    """Tick the robot's core along a plan: the time that a control period costs."""
    document = plan_scenario(read_scenario(ROOT / "examples" / "paper_five_real.toml"))
    driven = drive(document)[0]
    robot = Agent(0.0, 10_000_000)
    robot.hear_command(7, 1, 1, 0, 0, False, 0)
    for i in range(8):
        robot.hear_clock(i, i, i, i)
    robot.hear_plan(7, 1, *unpack_plan(driven.plan))
    assert robot.ride is not None
    start = robot.ride.follower.start_pose()
    robot.tick(1_000, *start)
    robot.hear_command(7, 2, 1, 1, 1_000, False, 2_000)
    curve, line = driven.curve, driven.timeline
    times = np.arange(0.0, line.finish, 0.01)
    s = np.array([line.s_at(t) for t in times])
    places, first = curve.derivatives(curve.parameter_at(s), 1)
    headings = np.arctan2(first[:, 1], first[:, 0])
    spent = []
    for i, (t, place, heading) in enumerate(
        zip(times.tolist(), places.tolist(), headings.tolist(), strict=True)
    ):
        now = 1_000 + round(t * 1e9)
        if i % 10 == 0:
            robot.hear_command(7, 3 + i, 1, 1, 1_000, False, now)
        begin = time.perf_counter_ns()
        robot.tick(now, place[0], place[1], heading)
        spent.append((time.perf_counter_ns() - begin) / 1000.0)
    cuts = np.percentile(spent, (50, 99))
    return [{"ticks": len(spent), "median us": cuts[0], "99th percentile us": cuts[1]}]


def show(title: str, rows: list[Row]) -> None:
    """Print rows as a table."""
    print(f"\n{title}")
    names = list(rows[0])
    cells = [[f"{v:.3g}" if isinstance(v, float) else str(v) for v in r.values()] for r in rows]
    widths = [max(len(row[i]) for row in [names, *cells]) for i in range(len(names))]
    for row in [names, *cells]:
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)))


def main() -> None:
    """Run everything, print, and write the results."""
    results = {}
    for name, bench in (("curves", curves), ("planning", planning), ("agent", agent)):
        results[name] = bench()
        show(name, results[name])
    folder = ROOT / "benchmarks" / "results"
    folder.mkdir(exist_ok=True)
    about = {"python": platform.python_version(), "machine": platform.machine(), **results}
    (folder / "benchmarks.json").write_text(json.dumps(about, indent=1) + "\n")


if __name__ == "__main__":
    main()
