"""The agent in C: what it takes on a Cortex-M4F, and how it compares with the Python agent.

`python -m benchmarks firmware` compares about a million events and runs 500 fleets, hours in all;
what it has done is kept in benchmarks/results/firmware.jsonl, and a run that was interrupted goes
on from there (trials.py).  The instructions of a tick are counted where `arm-none-eabi-gcc` and
`qemu-system-arm` are installed (Debian: gcc-arm-none-eabi, qemu-system-arm).
"""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from benchmarks.campaign import WORKERS
from benchmarks.firmware.trials import TICKS, TRIALS, events, fleets
from benchmarks.table import ROOT, Row
from firmware.micropython.native.build import WORK, native_code
from tests.firmware.building import (
    CORTEX_M4F,
    FIRMWARE,
    IN_PARTS,
    answers,
    code_size,
    host,
    objects,
    state_size,
)
from tests.firmware.streams import Trial, read_answers
from tests.golden.make_robot import VECTORS

_HERE: Final = Path(__file__).parent
_KEPT: Final = ROOT / "benchmarks" / "results" / "firmware.jsonl"
_NO_EMULATOR: Final[Row] = {"drive": "no arm-none-eabi-gcc or no qemu-system-arm"}
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
    """Return the bytes of code of each source, and those of the state."""
    code = code_size(objects(CORTEX_M4F))
    parts = {**code, "all code": sum(code.values()), "state of an agent": state_size()}
    return [{"part": name, "bytes": size} for name, size in parts.items()]


def comparison() -> list[Row]:
    """Return what a million events showed."""
    return events(range(TRIALS["events"][1]), WORKERS, _KEPT)


def c_fleets() -> list[Row]:
    """Return what 500 fleets of C agents showed."""
    return fleets(range(TRIALS["fleets"][1]), WORKERS, _KEPT)


def instructions() -> list[Row]:
    """Return the instructions of a tick on an emulated Cortex-M4F, for eight drives."""
    if not _can_emulate():
        return [_NO_EMULATOR]
    rows: list[Row] = []
    with TemporaryDirectory() as folder:
        image = _image(Path(folder), "emulated.c")
        for seed in range(8):
            lines = Trial(seed, trouble=0.0, cubic=True).stream(TICKS).lines
            told = _emulated(image, lines).splitlines()[-1]
            mean, most, mean_reading, most_reading, hearing = map(int, told.split()[1:])
            rows.append({
                "drive": seed, "mean of a tick": mean, "most": most,
                "mean while reading a Plan": mean_reading, "most then": most_reading,
                "most for a message": hearing,
            })  # fmt: skip
    return rows


def native_module() -> list[Row]:
    """Return how MicroPython's native module answers all golden vectors, run in emulated RAM."""
    if not _can_emulate():
        return [_NO_EMULATOR]
    rows: list[Row] = []
    with TemporaryDirectory() as name:
        folder = Path(name)
        code = native_code("armv7emsp", folder)
        (folder / "code.h").write_text(
            f"static const uint8_t CODE[] = {{{', '.join(map(str, code))}}};"
        )
        image, core = _image(folder, "native.c"), host(*IN_PARTS, WORK)
        for scene, vector in json.loads(VECTORS.read_text()).items():
            made = read_answers(_emulated(image, vector["events"]))
            pairs = list(zip(made, answers(core, vector["events"]), strict=True))
            rows.append({
                "scene": scene,
                "ticks": len(pairs),
                "phases differ": sum(a.phase != b.phase for a, b in pairs),
                "messages": sum(len(a.sent) for a, _ in pairs),
                "ticks whose messages differ": sum(a.sent != b.sent for a, b in pairs),
            })  # fmt: skip
    return rows


def _can_emulate() -> bool:
    return shutil.which(_GCC[0]) is not None and shutil.which(_QEMU[0]) is not None


def _image(folder: Path, program: str) -> Path:
    """Build the image of a program, with the core and headers of the folder."""
    image = folder / "image.elf"
    sources = [*map(str, objects(CORTEX_M4F)), str(_HERE / program)]
    script = [f"-I{folder}", "-T", str(_HERE / "cortex_m4.ld")]
    subprocess.run([*_GCC, *script, *sources, "-lm", "-o", str(image)], check=True)
    return image


def _emulated(image: Path, lines: list[str]) -> str:
    """Return what an image prints to the events of a stream."""
    text = "\n".join(lines) + "\n"
    command = [*_QEMU, str(image)]
    done = subprocess.run(command, input=text, text=True, capture_output=True, check=True)
    return done.stdout
