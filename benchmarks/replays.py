"""Logs of random faulty runs, replayed: `replay --check` on each.

`python -m benchmarks.replays COUNT` makes COUNT runs.  Scenarios, links and faults follow from the
seeds; in some runs the coordinator dies and resumes from its log.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import msgspec

from benchmarks.table import Row, show
from coordinator.base.errors import PlanError
from coordinator.log.log_file import read_log
from coordinator.planning.planner import plan_scenario
from coordinator.scenario.model import Scenario
from coordinator.service.replay import check_log
from protocol.codec import decode
from protocol.messages import Command
from sim.campaigns.campaign import Wish, run_seed
from sim.floors.generator import generate
from sim.floors.layout import Kind
from sim.world.fault_script import KINDS

RUNS: Final = 100
_FLOORS: Final[tuple[Kind, ...]] = ("polygons", "rooms", "circle", "open")
_ROBOTS: Final = 4


class Again(msgspec.Struct, frozen=True):
    """One run: the numbers of logs, epochs and messages, CPU [s] to make and check, differences."""

    seed: int
    logs: int
    epochs: int
    messages: int
    commands: int
    made_s: float
    checked_s: float
    differences: tuple[str, ...]


def run_and_check(seed: int) -> Again:
    """Make one run with faults of every kind, and replay each of its logs."""
    with TemporaryDirectory() as name:
        began = time.process_time()
        run_seed(_scenario(seed % len(_FLOORS)), seed, Wish(kinds=tuple(KINDS)), folder=Path(name))
        made = time.process_time()
        logs = [read_log(path) for path in Path(name).glob("run*.mcap")]
        checks = [check_log(log) for log in logs]
        checked = time.process_time()
    told = [
        message.epoch
        for log in logs
        for record in log.records
        if record.key.endswith("/command")
        and isinstance(message := decode("command", record.payload), Command)
    ]
    return Again(
        seed=seed,
        logs=len(logs),
        epochs=max(told, default=0),
        messages=sum(len(log.records) for log in logs),
        commands=sum(check.commands for check in checks),
        made_s=made - began,
        checked_s=checked - made,
        differences=tuple(check.difference for check in checks if check.difference),
    )


def replays(count: int = RUNS) -> list[Row]:
    """Make and check the logs of `count` runs; a difference is printed with its seed."""
    found = [run_and_check(seed) for seed in range(count)]
    for one in found:
        for difference in one.differences:
            sys.stderr.write(f"seed {one.seed}: {difference}\n")
    return [_row(found)]


def _row(found: Sequence[Again]) -> Row:
    return {
        "runs": len(found),
        "logs": sum(one.logs for one in found),
        "resumed": sum(one.logs - 1 for one in found),
        "with several epochs": sum(one.epochs > 1 for one in found),
        "most epochs": max(one.epochs for one in found),
        "messages": sum(one.messages for one in found),
        "commands again": sum(one.commands for one in found),
        "differ": sum(len(one.differences) for one in found),
        "s to make": sum(one.made_s for one in found) / len(found),
        "s to check": sum(one.checked_s for one in found) / len(found),
    }


@functools.cache
def _scenario(number: int) -> Scenario:
    """Return a generated scenario for which there is a plan."""
    seed = 0
    while True:
        scenario = generate(_FLOORS[number], _ROBOTS, seed)
        try:
            plan_scenario(scenario)
        except PlanError:
            seed += 1
        else:
            return scenario


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    show("logs of faulty runs, replayed", replays(count))


if __name__ == "__main__":
    main()
