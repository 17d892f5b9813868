"""The agent in C: what it takes on a Cortex-M4F, and how it compares with the Python agent.

`python -m benchmarks firmware` compares about a million events and runs 500 fleets, half an
hour in all.  The instructions of a tick are
counted where `arm-none-eabi-gcc` and `qemu-system-arm` are installed (Debian: gcc-arm-none-eabi,
qemu-system-arm).
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final
from unittest.mock import patch

from benchmarks.table import ROOT, Row
from coordinator.scenario_files.scenario_reader import read_scenario
from sim.campaigns.campaign import run_seed
from sim.world.virtual_fleet import World
from tests.firmware.building import (
    AS_PYTHON,
    CORE,
    CORTEX_M4F,
    FIRMWARE,
    IN_FLOAT,
    IN_PARTS,
    answers,
    code_size,
    host,
    objects,
    state_size,
)
from tests.firmware.c_service import CRobots
from tests.firmware.streams import Trial

_HERE: Final = Path(__file__).parent
_SCENARIO: Final = ROOT / "examples" / "paper_five_real.toml"
_FLEETS: Final = 500
_SEEDS: Final = 300
_TICKS: Final = 3000
_GCC: Final = (
    "arm-none-eabi-gcc", "-std=gnu11", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard",
    "-mfpu=fpv4-sp-d16", "-Os", "-ffp-contract=off", "-fno-math-errno",
    f"-I{FIRMWARE / 'include'}", "--specs=rdimon.specs", "-nostartfiles",
)  # fmt: skip
_QEMU: Final = (
    "qemu-system-arm", "-M", "mps2-an386", "-nographic", "-serial", "none", "-monitor", "none",
    "-icount", "shift=0", "-semihosting-config", "enable=on,target=native", "-kernel",
)  # fmt: skip


def sizes() -> list[Row]:
    """Return the bytes of code of each source, and of the state, with the largest frame allowed."""
    code = code_size(objects(CORTEX_M4F))
    rows: list[Row] = [{"part": name, "bytes": size} for name, size in code.items()]
    rows.append({"part": "all code and constants", "bytes": sum(code.values())})
    rows.append({"part": "state of an agent", "bytes": state_size()})
    return rows


def comparison() -> list[Row]:
    """Return how many events both agents were held against each other on, and what differed."""
    exact, close = host(*AS_PYTHON), host(*IN_FLOAT)
    events = ticks = differ = 0
    for seed in range(_SEEDS):
        stream = Trial(seed).stream(_TICKS)
        pairs = list(zip(answers(exact, stream.lines), stream.ticks, strict=True))
        events, ticks = events + len(stream.lines), ticks + len(pairs)
        differ += sum(repr(told) != repr(expected) for told, expected in pairs)
    in_double: Row = {"core": "double", "events": events, "ticks": ticks, "ticks differ": differ}
    events = ticks = differ = 0
    apart = 0.0
    for seed in range(_SEEDS // 10):
        stream = Trial(seed, trouble=0.0).stream(_TICKS)
        pairs = list(zip(answers(close, stream.lines), stream.ticks, strict=True))
        events, ticks = events + len(stream.lines), ticks + len(pairs)
        differ += sum(told.phase != expected.phase for told, expected in pairs)
        apart = max(apart, *(abs(told.place - expected.place) for told, expected in pairs))
    in_float: Row = {"core": "float", "events": events, "ticks": ticks, "ticks differ": differ}
    return [in_double, in_float | {"farthest apart mm": 1000.0 * apart}]


def c_fleets() -> list[Row]:
    """Return the outcome of seeded fleets with faults in which every robot runs the C agent."""
    scenario, core, usual = read_scenario(_SCENARIO), host(*IN_PARTS), World._service
    row: Row = {"runs": _FLEETS, "arrived": 0, "expected": 0, "touches": 0, "violations": 0}
    for seed in range(_FLEETS):
        robots = CRobots(core)
        with patch.object(World, "_service", robots.wrap(usual)):
            outcome = run_seed(scenario, seed)
        robots.end()
        found = (outcome.arrived, outcome.expected, len(outcome.touches), len(outcome.violations))
        for name, count in zip(list(row)[1:], found, strict=True):
            row[name] += count  # type: ignore[operator]
    return [row]


def instructions() -> list[Row]:
    """Return the instructions of a tick on an emulated Cortex-M4F, for eight drives."""
    if not (shutil.which(_GCC[0]) and shutil.which(_QEMU[0])):
        return [{"drive": "no arm-none-eabi-gcc or no qemu-system-arm"}]
    rows: list[Row] = []
    with TemporaryDirectory() as folder:
        image = Path(folder) / "image.elf"
        sources = [*map(str, CORE), str(_HERE / "emulated.c")]
        script = ["-T", str(_HERE / "cortex_m4.ld")]
        subprocess.run([*_GCC, *script, *sources, "-lm", "-o", str(image)], check=True)
        for seed in range(8):
            lines = Trial(seed, trouble=0.0, cubic=True).stream(_TICKS).lines
            text = "\n".join(lines) + "\n"
            done = subprocess.run(
                [*_QEMU, str(image)], input=text, text=True, capture_output=True, check=True
            )
            mean, most, mean_reading, most_reading, hearing = map(
                int, done.stdout.splitlines()[-1].split()[1:]
            )
            rows.append({
                "drive": seed, "mean of a tick": mean, "most": most,
                "mean while reading a Plan": mean_reading, "most then": most_reading,
                "most for a message": hearing,
            })  # fmt: skip
    return rows
