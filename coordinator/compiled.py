"""Compiling the few numeric kernels that numpy cannot do well: one decorator, one cache.

The machine code on disk is kept under a digest of all kernels' sources: numba notices a change of
the file that a kernel is in, but not of one whose kernels it calls.

Decides: how kernels are compiled and where their code is kept.  Must not know: what is computed.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar, cast

import numba

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays and numbers on first use; the machine code is kept on disk."""
    compile_it = numba.njit(cache=True, nogil=True, error_model="numpy")
    return cast(Callable[P, R], compile_it(function))


def _choose_cache() -> None:
    """Keep code beside the sources; where that may not be written, numba finds a place itself."""
    folder = Path(__file__).parent
    digest = hashlib.sha256()
    for source in sorted(folder.glob("*_kernels.py")):
        digest.update(source.read_bytes())
    cache = folder / "__pycache__"
    if os.access(cache if cache.exists() else folder, os.W_OK):
        numba.config.CACHE_DIR = str(  # type: ignore[attr-defined]
            cache / f"kernels-{digest.hexdigest()[:16]}"
        )


_choose_cache()
