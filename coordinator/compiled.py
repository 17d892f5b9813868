"""Compiling the few numeric kernels that numpy cannot do well: one decorator, one cache.

The machine code on disk is kept under a digest of the kernel's file and of all kernel files that
it imports: numba notices a change of the file that a kernel is in, but not of one whose kernels it
calls.

Decides: how kernels are compiled and where their code is kept.  Must not know: what is computed.
"""

from __future__ import annotations

import functools
import hashlib
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final, ParamSpec, TypeVar, cast

from coordinator.lean_numba import numba
from coordinator.quick_loading import load_quickly

P = ParamSpec("P")
R = TypeVar("R")

_FOLDER: Final = Path(__file__).parent
_CACHE: Final = _FOLDER / "__pycache__"
_IMPORT: Final = re.compile(r"^from coordinator\.(\w+_kernels) import", re.MULTILINE)

load_quickly()


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays and numbers on first use; the machine code is kept on disk."""
    _choose_cache(Path(function.__code__.co_filename))
    compile_it = numba.njit(cache=True, nogil=True, error_model="numpy")
    return cast(Callable[P, R], compile_it(function))


def is_compiled() -> bool:
    """Tell whether all kernels seem to have been compiled before, as far as the last ones tell."""
    files = [_FOLDER / f"{name}.py" for name in ("rest_kernels", "separation_kernels")]
    return all(any(_cache_of(file).glob("**/*.nbc")) for file in files)


@functools.cache
def _sources(file: Path) -> tuple[Path, ...]:
    """Return a file and all kernel files that it imports, directly or not."""
    found, waiting = {file}, [file]
    while waiting:
        for name in _IMPORT.findall(waiting.pop().read_text(encoding="utf-8")):
            source = _FOLDER / f"{name}.py"
            if source not in found:
                found.add(source)
                waiting.append(source)
    return tuple(sorted(found))


def _choose_cache(file: Path) -> None:
    """Keep code beside the sources; where that may not be written, numba finds a place itself."""
    if _may_write():
        numba.config.CACHE_DIR = str(_cache_of(file))


@functools.cache
def _may_write() -> bool:
    """Tell whether code may be kept beside the sources."""
    return os.access(_CACHE if _CACHE.exists() else _FOLDER, os.W_OK)


@functools.cache
def _cache_of(file: Path) -> Path:
    """Return where the code of a kernel file is kept."""
    digest = hashlib.sha256(b"".join(source.read_bytes() for source in _sources(file)))
    return _CACHE / f"kernels-{digest.hexdigest()[:16]}"
