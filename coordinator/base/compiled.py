"""Decorators that compile the few numeric kernels for which numpy is too slow.

Decides: how kernels are compiled.  Must not know: what is computed, where machine code is cached.
"""

from __future__ import annotations

from collections.abc import Callable
from types import NoneType
from typing import Any, Final, ParamSpec, TypeVar, get_args, get_type_hints

import numba

from coordinator.base.kernel_cache import keep, private
from coordinator.base.quick_loading import load_quickly

P = ParamSpec("P")
R = TypeVar("R")

_NUMBERS: Final = (bool, float, int, NoneType)

_OPTIONS: Final[dict[str, Any]] = {"nogil": True, "error_model": "numpy"}

_UNCOUNTED: Final = {"_nrt": False} if hasattr(private("cpu.CPUTargetOptions"), "_nrt") else {}
"""What switches numba's counting of references off, if this numba has it."""

load_quickly()


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function of arrays and numbers on first use; cache the machine code on disk.

    With numba's compilation switched off (NUMBA_DISABLE_JIT=1) it stays as it is.
    """
    return _kernel(function, _OPTIONS)


def allocation_free(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function that makes no arrays and returns only numbers; else as `compiled`.

    numba counts the references to each array that a function passes on, which took half of the
    time of searches that pass many arrays to small functions.  An array that is only borrowed
    needs no count.  Raises TypeError if the function does not declare to return numbers or None;
    if it makes an array, even a slice, numba refuses to compile it.
    """
    returned = get_type_hints(function)["return"]
    if not _is_of_numbers(returned):
        raise TypeError(f"{function.__qualname__} may return only numbers, not {returned}")
    return _kernel(function, _OPTIONS | _UNCOUNTED)


def _is_of_numbers(kind: type) -> bool:
    """Tell whether values of a type are numbers, tuples of numbers, or None."""
    parts = get_args(kind) or get_type_hints(kind).values()
    return kind in _NUMBERS or (bool(parts) and all(_is_of_numbers(part) for part in parts))


def _kernel(function: Callable[P, R], options: dict[str, Any]) -> Callable[P, R]:
    kernel: Callable[P, R] = numba.njit(**options)(function)
    if kernel is not function:
        keep(kernel)
    return kernel
