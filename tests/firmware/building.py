"""The firmware built by zig's C compiler, kept by content: for tests and benchmarks.

Nothing is built again while no source and no option has changed.
"""

from __future__ import annotations

import hashlib
import os
import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Final

from tests.firmware.streams import Tick, read_answers

FIRMWARE: Final = Path(__file__).parents[2] / "firmware"
CORE: Final = sorted((FIRMWARE / "src").glob("*.c"))
PROBE: Final = Path(__file__).with_name("state.c")
HOST: Final = [*CORE, FIRMWARE / "examples" / "host.c"]

STRICT: Final = (
    "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wdouble-promotion", "-Wconversion", "-Wshadow",
    "-Werror", "-ffp-contract=off", "-fno-math-errno", f"-I{FIRMWARE / 'include'}",
)  # fmt: skip

CORTEX_M4F: Final = (
    "-Wframe-larger-than=512",
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


def answers(core: Path, lines: list[str]) -> list[Tick]:
    """Return what a host program answers to the events of a stream."""
    text = "\n".join(lines) + "\n"
    done = subprocess.run([core], input=text, capture_output=True, text=True, check=True)
    return read_answers(done.stdout)


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


def section_sizes(object_file: Path) -> dict[str, int]:
    """Return the bytes of each section of a 32-bit little-endian ELF file, by name."""
    data = object_file.read_bytes()
    (table,) = struct.unpack_from("<I", data, 32)
    size, count, names = struct.unpack_from("<HHH", data, 46)
    heads = [struct.unpack_from("<10I", data, table + i * size) for i in range(count)]
    words = heads[names][4]
    sizes: dict[str, int] = {}
    for head in heads:
        start = words + head[0]
        name = data[start : data.index(b"\0", start)].decode()
        sizes[name] = sizes.get(name, 0) + head[5]
    return sizes


def code_size(files: list[Path]) -> dict[str, int]:
    """Return the bytes of code and constants of object files, by name."""
    return {
        file.stem: sum(
            size
            for name, size in section_sizes(file).items()
            if name.startswith((".text", ".rodata"))
        )
        for file in files
    }


def state_size(*options: str) -> int:
    """Return the bytes of an agent on a Cortex-M4F."""
    probe = built([PROBE], (*CORTEX_M4F, *options, "-c"), "state.o", link=())
    return section_sizes(probe)[".bss"]


def _place(options: tuple[str, ...], name: str) -> Path:
    digest = hashlib.sha256(" ".join((*STRICT, *options)).encode())
    for path in sorted(FIRMWARE.rglob("*.[ch]")):
        digest.update(path.read_bytes())
    root = Path(os.environ.get("XDG_CACHE_HOME") or tempfile.gettempdir())
    return root / f"splinefleet-firmware-{os.getuid()}" / digest.hexdigest()[:16] / name
