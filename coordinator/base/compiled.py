"""A decorator that compiles the few numeric kernels for which numpy is too slow.

Decides: how kernels are compiled.  Must not know: what is computed, where machine code is cached.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

import numba

from coordinator.base.kernel_cache import keep
from coordinator.base.quick_loading import load_quickly

P = ParamSpec("P")
R = TypeVar("R")

load_quickly()


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays and numbers on first use; cache the machine code on disk.

    With numba's compilation switched off (NUMBA_DISABLE_JIT=1) it stays as it is.
    """
    kernel = numba.njit(nogil=True, error_model="numpy")(function)
    if kernel is not function:
        keep(kernel)
    return cast(Callable[P, R], kernel)
