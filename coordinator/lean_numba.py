"""Importing numba without what it only looks whether it is there.

numba imports SciPy to compare its version, and PyYAML for a configuration file that we do not have;
the locked dependencies answer the first, and the second is left to whoever needs it.

Decides: what numba finds when it is imported.  Must not know: kernels.
"""

from __future__ import annotations

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
