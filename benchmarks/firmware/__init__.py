"""The agent in C: what it takes on a Cortex-M4F, and how it compares with the Python agent.

`python -m benchmarks firmware` compares about a million events and runs 500 fleets, hours in all;
what it has done is kept in benchmarks/results/firmware.jsonl, and a run that was interrupted goes
on from there (trials.py).  The instructions of a tick are counted where `arm-none-eabi-gcc` and
`qemu-system-arm` are installed (Debian: gcc-arm-none-eabi, qemu-system-arm).
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.campaign import WORKERS
from benchmarks.firmware.trials import TICKS, TRIALS, events, fleets
from benchmarks.table import ROOT, Row
from tests.firmware.building import CORE, CORTEX_M4F, FIRMWARE, code_size, objects, state_size
from tests.firmware.streams import Trial

_HERE: Final = Path(__file__).parent
_KEPT: Final = ROOT / "benchmarks" / "results" / "firmware.jsonl"
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
    """Return what a million events showed."""
    return events(range(TRIALS["events"][1]), WORKERS, _KEPT)


def c_fleets() -> list[Row]:
    """Return what 500 fleets of C agents showed."""
    return fleets(range(TRIALS["fleets"][1]), WORKERS, _KEPT)


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
            lines = Trial(seed, trouble=0.0, cubic=True).stream(TICKS).lines
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
