"""Real processes that are killed, stopped and continued at random: who touches, who arrives.

Run as `python -m benchmarks.outage [ROBOTS] [RUNS] [TOGETHER]`.  In every run one robot's process
or the coordinator's is killed, stopped for good, or stopped for 2 s; a killed coordinator is
started again.  The judge looks at the black boxes.  All programs run on this machine, TOGETHER
fleets at a time.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from random import Random
from typing import Final, NamedTuple

import msgspec
from msgspec.structs import replace

from benchmarks.table import Row, show
from coordinator.findings.info import summarise
from coordinator.log.log_file import read_log
from coordinator.scenario.model import Scenario
from sim.floors.generator import generate
from sim.judging.judge import judge
from sim.processes.boxed_log import newest_log
from sim.processes.local_fleet import LocalFleet
from sim.world.fault_text import parse_faults

KINDS: Final = ("kill", "hang", "hang 2 s", "coordinator-restart", "coordinator-hang 2 s")
"""What happens to a process, in turn."""
LATEST: Final = 20.0
"""Faults strike up to this time after the first GO [s]."""


class Run(NamedTuple):
    """One run: robots that arrived, that touch, how often the fleet froze, who was held."""

    kind: str
    fault: str
    arrived: int
    collisions: int
    freezes: int
    held: int


def outages(robots: int = 17, runs: int = 50, together: int = 2) -> list[Row]:
    """Return a row for each kind of fault, and one for each run in which somebody touched."""
    scenario = replace(generate("open", robots, 1), name="outage")
    with ThreadPoolExecutor(together) as pool:
        found = list(pool.map(partial(_outage, scenario), range(runs)))
    rows = [_row(kind, robots, [run for run in found if run.kind == kind]) for kind in KINDS]
    rows += [{"fault": run.fault, "collisions": run.collisions} for run in found if run.collisions]
    return rows


def _row(kind: str, robots: int, runs: Sequence[Run]) -> Row:
    return {
        "fault": kind,
        "runs": len(runs),
        "arrived": f"{sum(run.arrived for run in runs)} of {robots * len(runs)}",
        "collisions": sum(run.collisions for run in runs),
        "freezes": sum(run.freezes for run in runs),
        "robots held, a run": sum(run.held for run in runs) / max(len(runs), 1),
    }


def _outage(scenario: Scenario, number: int) -> Run:
    kind, dice = KINDS[number % len(KINDS)], Random(number)
    name, _, seconds = kind.partition(" ")
    whose = "" if name.startswith("coordinator") else f":{dice.choice(scenario.robots).id}"
    text = f"{name}{whose}@{dice.uniform(0.0, LATEST):.2f}" + (":2" if seconds else "")
    faults = parse_faults([text], [robot.id for robot in scenario.robots])
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        LocalFleet(scenario, folder, speed=1.0, effort=20, faults=faults).run()
        verdict, told = judge(folder), summarise(read_log(newest_log(folder)))
    return Run(
        kind,
        text,
        sum(robot.arrived for robot in verdict.robots),
        verdict.collisions,
        int(str(told["freezes"])),
        len({one["robot"] for one in msgspec.convert(told["held"], list[dict[str, object]])}),
    )


if __name__ == "__main__":
    asked = [int(text) for text in sys.argv[1:]]
    show("processes killed and stopped at random", outages(*asked))
