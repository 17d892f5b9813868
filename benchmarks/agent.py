"""The robot's core and its process: the cost of a tick, and how many robots one machine can run.

`python -m benchmarks agent` measures the tick, and
`python -m benchmarks.agent [COUNT [SECONDS [RATE]]]`
also that many robots as processes, at RATE ticks a second, with a coordinator.
"""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
import tracemalloc
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from benchmarks.campaign import record
from benchmarks.lanes import lanes
from benchmarks.table import ROOT, Row
from coordinator.plan.wire import Driven, drive
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario, scenario_to_json
from protocol.phases import GO, HOLD
from protocol.plan_parts import PlanParts, unpack_plan
from robot_agent.core.agent import Agent
from robot_agent.core.ride import NOTHING
from sim.processes.local_fleet import free_port

HEADROOM_MS: Final = 1_041
"""What Commands grant a robot that nobody holds, beyond the plan's time."""

_RIDES: Final = 9
_SPEED: Final = 0.5
_COMMAND: Final = (sys.executable, "-m", "splinefleet")
_GOODBYE_S: Final = 20.0
_MOST_EPOCHS: Final = 10
Process = subprocess.Popen[str]


def agent() -> list[Row]:
    """Run the robot's core along a plan; measure the time of a tick and the size of its state.

    On a machine with other work some ticks contain a pause.  To leave pauses out, a second 99th
    percentile is taken of each tick's median over several rides of the same plan.
    """
    driven = drive(plan_scenario(read_scenario(ROOT / "examples" / "paper_five_real.toml")))[0]
    parts = unpack_plan(driven.plan)
    tracemalloc.start()
    robot = _armed(parts)
    size = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    riders = (robot, *(_armed(parts) for _ in range(_RIDES - 1)))
    spent = np.array([_ride(driven, rider) for rider in riders])
    cuts, own = np.percentile(spent, (50, 99)), np.percentile(np.median(spent, axis=0), 99)
    return [
        {
            "ticks": spent.shape[1],
            "median us": float(cuts[0]),
            "99th percentile us": float(cuts[1]),
            "without pauses us": float(own),
            "state KiB": size / 1024.0,
            "control points": len(parts.path[2]),
        }
    ]


def _armed(parts: PlanParts) -> Agent:
    """Return a robot that knows its plan."""
    robot = Agent(0.0, 10_000_000)
    robot.hear_command(7, 1, 1, 1, HOLD, 0, 0, NOTHING, False, 0)
    robot.hear_plan(7, 1, 0, 0, *parts)
    return robot


def _ride(driven: Driven, robot: Agent) -> list[float]:
    """Return the time of each tick of a whole plan [us]."""
    for i in range(8):
        robot.clock.ask(i)
        robot.hear_clock(7, i, i, i, i)
    assert robot.ride is not None
    robot.tick(1_000, *robot.ride.follower.start_pose())
    robot.hear_command(7, 1, 2, 1, GO, 1_000, 2_000, HEADROOM_MS, False, 2_000)
    spent = []
    for i, (t, x, y, heading) in enumerate(_seen(driven)):
        now = 1_000 + round(t * 1e9)
        if i % 10 == 0:
            granted = round(1000.0 * t) + HEADROOM_MS
            robot.hear_command(7, 1, 3 + i, 1, GO, 1_000, now, granted, False, now)
        begin = time.perf_counter_ns()
        robot.tick(now, x, y, heading)
        spent.append((time.perf_counter_ns() - begin) / 1000.0)
    return spent


def _seen(driven: Driven) -> list[list[float]]:
    """Return plan time, x, y and heading of a robot that keeps to its plan, every 10 ms."""
    curve, line = driven.curve, driven.timeline
    times = np.arange(0.0, line.finish, 0.01)
    s = np.array([line.s_at(t) for t in times])
    places, first = curve.derivatives(curve.parameter_at(s), 1)
    headings = np.arctan2(first[:, 1], first[:, 0])
    rows: list[list[float]] = np.column_stack((times, places, headings)).tolist()
    return rows


def fleet_of_agents(count: int, seconds: float, rate: int) -> list[Row]:
    """Run `count` robots at once as processes, at `rate` ticks a second, for `seconds`.

    Ticks and overruns are counted while robots move, in all epochs: a robot that is late because it
    got no processor makes the fleet freeze and continue with the next epoch.  The worst tick is
    that since the process began.  CPU is the share of one core, over all threads, while robots
    move.  Other work on this machine is the CPU of this machine less that of robots and
    coordinator; `taken` is the share of the cores that other machines on the same hardware took.
    """
    with TemporaryDirectory() as name, _ended() as processes:
        folder = Path(name)
        coordinator = _start_fleet(folder, count, seconds, rate, processes)
        before, began = [_cpu_s(process) for process in processes], time.monotonic()
        busy, taken = _busy_s(), _taken_s()
        time.sleep(seconds)
        passed = time.monotonic() - began
        spent = [_cpu_s(process) - was for process, was in zip(processes, before, strict=True)]
        busy, taken = _busy_s() - busy, _taken_s() - taken
        said, _ = coordinator.communicate(timeout=_MOST_EPOCHS * seconds + _GOODBYE_S)
        for process in processes:
            process.wait(_GOODBYE_S)
        counts = [_counted(folder / f"R{i + 1}.jsonl") for i in range(count)]
    events = [json.loads(line) for line in said.splitlines()]
    ticks, overruns, failures = (sum(part) for part in list(zip(*counts, strict=True))[:3])
    return [
        {
            "robots": count,
            "ticks a second": rate,
            "arrived": sum(robot["phase"] == "done" for robot in events[-1]["robots"]),
            "freezes": sum(e["event"] == "phase" and e["text"] == "FREEZE" for e in events),
            "ticks": ticks,
            "overruns %": 100.0 * overruns / max(ticks, 1),
            "failures": failures,
            "worst tick ms": max(part[3] for part in counts) / 1000.0,
            "CPU of a robot %": 100.0 * sum(spent[1:]) / count / passed,
            "CPU of all robots %": 100.0 * sum(spent[1:]) / passed,
            "CPU of the coordinator %": 100.0 * spent[0] / passed,
            "CPU of this machine %": 100.0 * busy / passed,
            "taken %": 100.0 * taken / passed,
            "cores": os.cpu_count() or 0,
        }
    ]


def _start_fleet(
    folder: Path, count: int, seconds: float, rate: int, processes: list[Process]
) -> Process:
    """Start a coordinator and its robots; return the coordinator when it has sent GO."""
    scenario = folder / "lanes.json"
    scenario.write_bytes(scenario_to_json(lanes(count, seconds)))
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    coordinator = subprocess.Popen(
        [
            *(*_COMMAND, "coordinator", str(scenario), f"--listen={endpoint}", "--json"),
            *("--effort=0", f"--wait={60 + 2 * count}"),
        ],
        stdout=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    )
    processes.append(coordinator)
    assert coordinator.stdout is not None
    line = "it printed nothing"
    for line in coordinator.stdout:
        event = json.loads(line)
        if event["event"] == "listening":
            processes.extend(
                _start_robot(folder, f"R{i + 1}", endpoint, rate) for i in range(count)
            )
        elif event["event"] == "phase" and event["text"] == "GO":
            return coordinator
    raise RuntimeError(f"the coordinator ended before GO: {line}")


def _start_robot(folder: Path, robot: str, endpoint: str, rate: int) -> Process:
    with (folder / f"{robot}.jsonl").open("w") as counts:
        return subprocess.Popen(
            [
                *(*_COMMAND, "agent", robot, f"--connect={endpoint}", "--fleet=lanes"),
                *("--radius=0.2", f"--max-speed={_SPEED}", f"--max-accel={_SPEED}"),
                *(f"--rate={rate}", "--stats", "--quiet", "--give-up=30", "--wait=60"),
            ],
            stdout=counts,
            stdin=subprocess.DEVNULL,
            text=True,
        )


def _counted(path: Path) -> tuple[int, int, int, int]:
    """Return ticks, overruns and failures while moving, and the worst tick [us] ever."""
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    rides = [(a, b) for a, b in pairwise(lines) if a["state"] == "moving"]
    names = ("ticks", "overruns", "failures")
    ticks, overruns, failures = (sum(b[name] - a[name] for a, b in rides) for name in names)
    return ticks, overruns, failures, lines[-1]["worst_tick_us"]


def _cpu_s(process: Process) -> float:
    """Return the processor time [s] that a process has taken."""
    try:
        fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    except FileNotFoundError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _busy_s() -> float:
    """Return the processor time [s] that all programs on this machine have taken."""
    fields = _machine_s()
    return sum(fields[:8]) - fields[3] - fields[4]


def _taken_s() -> float:
    """Return the processor time [s] that this virtual machine needed and did not get (steal)."""
    return _machine_s()[7]


def _machine_s() -> list[float]:
    """Return the first line of /proc/stat in seconds: user, nice, system, idle, ..., steal."""
    fields = Path("/proc/stat").read_text().splitlines()[0].split()[1:]
    return [int(part) / os.sysconf("SC_CLK_TCK") for part in fields]


@contextlib.contextmanager
def _ended() -> Iterator[list[Process]]:
    """Yield a list; every process put into it is ended, by its id, when the block is left."""
    processes: list[Process] = []
    try:
        yield processes
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
            process.wait()
            if process.stdout is not None:
                process.stdout.close()


def main() -> None:
    """Measure, and write benchmarks/results/agent_fleet.json."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
    count, seconds, rate = (*map(int, sys.argv[1:]), *(100, 20, 50)[len(sys.argv) - 1 :])
    record(
        "agent_fleet",
        {
            "one tick of the robot's core": agent(),
            "robot processes and a coordinator": fleet_of_agents(count, seconds, rate),
        },
    )


if __name__ == "__main__":
    main()
