"""The robot's core: what one tick of its control loop costs."""

from __future__ import annotations

import time

import numpy as np

from benchmarks.table import ROOT, Row
from coordinator.planner import plan_scenario
from coordinator.scenario_file import read_scenario
from coordinator.wire import drive
from protocol.plan_parts import unpack_plan
from robot_agent.agent import Agent


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
