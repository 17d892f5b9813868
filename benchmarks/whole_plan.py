"""The whole command `plan`, including its process, for growing fleets: time, CPU time, memory.

Decides: which scenes, and what counts as one run.  Kernels have been compiled before.
"""

from __future__ import annotations

import json
import math
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final, NamedTuple

from benchmarks.table import ROOT, Row
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.scenario_files.toml_writer import scenario_to_toml
from sim.floors.generator import generate

_PER_ROBOT: Final = 10.0
"""Area [m^2] of the open floor for each robot: 1,000 of them are on 100 m x 100 m."""

_RUNS: Final = {5: 7, 17: 5, 100: 5, 300: 3, 1000: 2}
"""How often each size is run."""


class Spent(NamedTuple):
    """One run: real time and CPU time [s], peak memory [MB], and the planner's own time [s]."""

    clock: float
    cpu: float
    memory: float
    planner: float


def whole_plan() -> list[Row]:
    """Plan scenes, each in a process of its own; return medians."""
    scenes = [(read_scenario(ROOT / "examples" / "paper_five.toml"), 5)]
    scenes += [(_open(count), count) for count in (17, 100, 300, 1000)]
    scenes.insert(3, (generate("warehouse", 100, 1), 100))
    rows: list[Row] = []
    with tempfile.TemporaryDirectory() as folder:
        for scene, count in scenes:
            file = Path(folder) / "scene.toml"
            file.write_bytes(scenario_to_toml(scene))
            runs = [_run(file, Path(folder) / "plan.json") for _ in range(_RUNS[count])]
            middle = Spent(*(statistics.median(column) for column in zip(*runs, strict=True)))
            rows.append(
                {
                    "scene": scene.name,
                    "robots": count,
                    "clock s": middle.clock,
                    "CPU s": middle.cpu,
                    "planner ms": 1000.0 * middle.planner,
                    "MB": middle.memory,
                    "clock ms a robot": 1000.0 * middle.clock / count,
                }
            )
    return rows


_STOPWATCH: Final = """
import json, os, sys, time
nowhere = os.open(os.devnull, os.O_WRONLY)
begin = time.perf_counter()
process = os.posix_spawn(
    sys.argv[1],
    sys.argv[1:],
    os.environ,
    file_actions=[(os.POSIX_SPAWN_DUP2, nowhere, fd) for fd in (1, 2)],
)
_, status, usage = os.wait4(process, 0)
clock = time.perf_counter() - begin
print(json.dumps([clock, usage.ru_utime + usage.ru_stime, usage.ru_maxrss]))
sys.exit(os.waitstatus_to_exitcode(status))
"""
"""Runs a command and prints the time by the clock and of the CPU [s], and its peak memory [kB]."""


def _open(count: int) -> Scenario:
    side = math.sqrt(_PER_ROBOT * count)
    return generate("open", count, 1, size=(side, side))


def _run(scene: Path, plan: Path) -> Spent:
    """Run the command once, from a small process: a child's peak begins at its parent's."""
    command = [sys.executable, "-m", "splinefleet", "plan", str(scene), "-o", str(plan)]
    done = subprocess.run(
        [sys.executable, "-S", "-c", _STOPWATCH, *command],
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        check=True,
    )
    clock, cpu, memory = json.loads(done.stdout)
    timing = json.loads(plan.read_text())["timing"]
    return Spent(clock, cpu, memory / 1000.0, sum(timing.values()))
