"""The firmware built by zig's C compiler, kept by content: for tests and benchmarks.

Nothing is built again while no source and no option has changed.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

FIRMWARE: Final = Path(__file__).parents[2] / "firmware"
CORE: Final = sorted((FIRMWARE / "src").glob("*.c"))
HOST: Final = [*CORE, FIRMWARE / "examples" / "host.c"]

STRICT: Final = (
    "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wdouble-promotion", "-Wconversion", "-Wshadow",
    "-Werror", "-ffp-contract=off", "-fno-math-errno", f"-I{FIRMWARE / 'include'}",
)  # fmt: skip

CORTEX_M4F: Final = (
    "-target", "thumb-freestanding-eabihf", "-mcpu=cortex_m4+vfp4d16sp", "-Os",
    "-fno-sanitize=undefined", "-fno-unwind-tables", "-fno-asynchronous-unwind-tables",
)  # fmt: skip

SANITIZED: Final = ("-O1", "-g", "-fsanitize=undefined", "-fsanitize-trap=undefined")

ROOMY: Final = ("-DSF_POINTS=450", "-DSF_STOPS=300", "-DSF_SPEEDS=720", "-DSF_BYTES=4000")
"""Room for every Plan that fits a message."""

AS_PYTHON: Final = (*ROOMY, "-DSF_DOUBLE", "-DSF_WORK=0")
"""Double precision, and Plans read at once."""

IN_FLOAT: Final = (*ROOMY, "-DSF_CELLS=1400", "-DSF_WORK=0")

IN_PARTS: Final = ()
"""As on a microcontroller: default sizes, float, Plans read over several ticks."""


def host(*options: str) -> Path:
    """Return the host program, built with undefined behaviour ending it."""
    return built(HOST, (*SANITIZED, *options), "host", link=("-lm",))


def built(sources: list[Path], options: tuple[str, ...], name: str, link: tuple[str, ...]) -> Path:
    """Return what the compiler makes of the sources; raises CalledProcessError if it complains."""
    place = _place(options, name)
    if not place.exists():
        place.parent.mkdir(parents=True, exist_ok=True)
        making = place.with_name(f"{name}-{os.getpid()}")
        compile_c(*options, *map(str, sources), *link, "-o", str(making))
        making.replace(place)
    return place


def objects(options: tuple[str, ...]) -> list[Path]:
    """Return the core's object files, one per source."""
    return [built([source], (*options, "-c"), f"{source.stem}.o", link=()) for source in CORE]


def compile_c(*arguments: str) -> str:
    """Run the compiler with the strict options, and return what it says."""
    command = [sys.executable, "-m", "ziglang", "cc", *STRICT, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}\n{done.stderr}")
    return done.stderr


def _place(options: tuple[str, ...], name: str) -> Path:
    digest = hashlib.sha256(" ".join((*STRICT, *options)).encode())
    for path in sorted(FIRMWARE.rglob("*.[ch]")):
        digest.update(path.read_bytes())
    root = Path(os.environ.get("XDG_CACHE_HOME") or tempfile.gettempdir())
    return root / f"splinefleet-firmware-{os.getuid()}" / digest.hexdigest()[:16] / name
