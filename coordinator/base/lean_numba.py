"""Importing numba without what it only looks whether it is there.

numba imports SciPy to compare its version, and PyYAML for a configuration file that we do not have;
the locked dependencies answer the first, and the second is left to whoever needs it.

Decides: what numba finds when it is imported, and how its private names are asked for.  Must not
know: kernels.
"""

from __future__ import annotations

import functools
import importlib
import sys
from types import ModuleType
from typing import Any, Final, TypeAlias, cast

_Numba: TypeAlias = Any  # the module, which has no types

_ONLY_LOOKED_FOR: Final = ("scipy", "yaml")


def _import_numba() -> _Numba:
    """Return numba, imported as if optional packages were absent unless they are loaded."""
    modules = cast(dict[str, ModuleType | None], sys.modules)
    hidden = [name for name in _ONLY_LOOKED_FOR if name not in modules]
    modules.update(dict.fromkeys(hidden))
    try:
        return importlib.import_module("numba")
    finally:
        for name in hidden:
            del modules[name]


numba: Final[_Numba] = _import_numba()


def private(path: str) -> _Numba:
    """Return what numba.core calls by a dotted name; None where this numba does not.

    Such names may change with any release, so who uses one goes without where it is not there.
    """
    return functools.reduce(
        lambda owner, name: getattr(owner, name, None), path.split("."), numba.core
    )
