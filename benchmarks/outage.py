"""Deaths of real robot processes: how soon the fleet gets FREEZE, is at rest, and goes on.

Run as `python -m benchmarks.outage [ROBOTS] [TIMES]`.  Times are those of the coordinator's log and
of the black boxes, all on one host's clock; all robots run on this machine.
"""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from msgspec.structs import replace

from benchmarks.table import Row, show
from coordinator.log.log_file import read_log
from coordinator.plan.plan_file import read
from coordinator.scenario.model import Scenario
from protocol.codec import decode
from protocol.messages import Command
from protocol.phases import FREEZE, GO
from protocol.timing import SECOND
from sim.floors.generator import generate
from sim.judging.blackbox import read_blackbox
from sim.processes.local_fleet import LocalFleet
from sim.world.fault_text import parse_faults

_STILL: Final = 2e-4
"""A robot that moves less than this [m] between two rows rests."""


def outages(robots: int = 17, times: int = 5) -> list[Row]:
    """Kill a robot of a warehouse, and stop one, several times each; measure the reaction times."""
    scenario = replace(generate("warehouse", robots, 1), name="outage")
    rows = []
    for kind in ("kill", "hang"):
        measured = [_outage(scenario, f"{kind}:R{3 + k}@{4 + 0.37 * k}") for k in range(times)]
        for index, what in enumerate(("to FREEZE", "to rest", "FREEZE to GO")):
            values = [one[index] for one in measured]
            rows.append(
                {
                    "fault": kind,
                    "ms": what,
                    "median": 1000.0 * statistics.median(values),
                    "most": 1000.0 * max(values),
                    "tau": 1000.0 * measured[0][3],
                }
            )
    return rows


def _outage(scenario: Scenario, text: str) -> tuple[float, float, float, float]:
    """Return times [s]: death to FREEZE, death to rest of all, FREEZE to the next GO; and tau."""
    faults = parse_faults([text], [robot.id for robot in scenario.robots])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        LocalFleet(scenario, folder, speed=1.0, effort=20, faults=faults).run()
        log = read_log(folder / "run.mcap")
        turns = []
        for record in log.records:
            message = decode("command", record.payload) if record.key.endswith("/command") else None
            if isinstance(message, Command):
                turns.append((record.log_ns, message.epoch, message.phase, message.start_ns))
        first = next(start for _, _, phase, start in turns if phase == GO)
        frozen = next(now for now, _, phase, _ in turns if phase == FREEZE)
        again = next(now for now, epoch, phase, _ in turns if phase == GO and epoch > 1)
        struck = faults[0].robot
        death = float(read_blackbox(folder / "blackbox" / f"{struck}.csv").t[-1])
        last = 0.0
        for robot in scenario.robots:
            box = read_blackbox(folder / "blackbox" / f"{robot.id}.csv")
            moved = np.hypot(*np.diff(box.places, axis=0).T) > _STILL
            here = moved & (box.t[1:] >= death) & (box.t[1:] < (again - first) / SECOND)
            last = max(last, float(box.t[1:][here].max(initial=death)) - death)
        tau = read(folder / "plan.json").tau
    return (frozen - first) / SECOND - death, last, (again - frozen) / SECOND, tau


if __name__ == "__main__":
    asked = [int(text) for text in sys.argv[1:]]
    show("deaths of real robots", outages(*asked))
