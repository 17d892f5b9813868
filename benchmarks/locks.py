"""The cost of keys: the same fleets are armed alternately without and with them.

Processes, links and messages are those of a run; each fleet is ended as soon as GO is sent.  Times
are real seconds; CPU is the sum over its processes.
"""

from __future__ import annotations

import datetime
import json
import resource
import statistics
import subprocess
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Final, NamedTuple

from msgspec.structs import replace

from benchmarks.table import ROOT, Row
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import read_scenario, scenario_to_json
from coordinator.security.key_store import KeyStore
from sim.floors.generator import generate
from sim.processes.local_fleet import free_port
from sim.processes.programs import Programs

_DAYS: Final = 30


class _Arming(NamedTuple):
    """Seconds from the first process to GO and from the coordinator's link to GO, and of CPU."""

    whole: float
    link: float
    cpu: float


def arming(times: int = 7) -> list[Row]:
    """Arm two fleets several times, the larger one less often; returns medians and ratios."""
    fleets = [
        (read_scenario(ROOT / "examples" / "paper_five.toml"), times),
        (replace(generate("warehouse", 17, 1), name="locks"), max(1, times // 3)),
    ]
    rows: list[Row] = []
    for scenario, rounds in fleets:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            keys = _keys_for(scenario, folder / "keys")
            (folder / "blackbox").mkdir()
            (folder / "scenario.json").write_bytes(scenario_to_json(scenario))
            _arm(scenario, folder, None)  # compiles and fills caches, not measured
            pairs = [
                (_arm(scenario, folder, None), _arm(scenario, folder, keys)) for _ in range(rounds)
            ]
        for field in _Arming._fields:
            plain = statistics.median(getattr(one, field) for one, _ in pairs)
            locked = statistics.median(getattr(one, field) for _, one in pairs)
            rows.append(
                {
                    "fleet": scenario.name,
                    "robots": len(scenario.robots),
                    "seconds": field,
                    "without": plain,
                    "with keys": locked,
                    "ratio": locked / plain,
                }
            )
    return rows


def _keys_for(scenario: Scenario, folder: Path) -> Path:
    now = datetime.datetime.now(datetime.UTC)
    store = KeyStore(folder)
    store.begin(now)
    store.issue("coordinator", ["coordinator"], now, _DAYS)
    store.issue("robot", [robot.id for robot in scenario.robots], now, _DAYS)
    return folder


def _arm(scenario: Scenario, folder: Path, keys: Path | None) -> _Arming:
    """Start a fleet, wait for GO, end it, and return the times."""
    programs = Programs(folder, scenario.name, 1.0, 20, keys)
    meet = programs.endpoint(free_port())
    before = _cpu_s()
    began = listened = time.monotonic()
    gone = 0.0
    with ExitStack() as stack:
        processes = []

        def start(command: list[str], output: int) -> subprocess.Popen[str]:
            process = subprocess.Popen(
                command, stdout=output, stderr=subprocess.DEVNULL, text=True, cwd=ROOT
            )
            processes.append(stack.enter_context(process))
            return process

        coordinator = start(programs.coordinator(f"--listen={meet}"), subprocess.PIPE)
        assert coordinator.stdout is not None
        for line in coordinator.stdout:
            event = json.loads(line)
            if event["event"] == "listening":
                listened = time.monotonic()
                for robot in scenario.robots:
                    start(programs.agent(robot, meet, faulty=False), subprocess.DEVNULL)
            elif (event["event"], event.get("text")) == ("phase", "GO"):
                gone = time.monotonic()
                break
        for process in processes:
            process.terminate()
    return _Arming(gone - began, gone - listened, _cpu_s() - before)


def _cpu_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
