"""Loading cached machine code in a third of the time, by deferring what only compiling needs.

numba caches two things for each compiled function: machine code, and bitcode with which functions
compiled later are linked.  It reads both at once, and initializes its whole compiler first; a
process that compiles nothing needs neither the bitcode nor the compiler.  The compiler also imports
SciPy's linear algebra only to check that it is installed.  Measured CPU time: the kernels of a plan
load in 0.13 s; without bitcode, but with the compiler initialized, in 0.30 s.

Decides: which part of a cached kernel is read when.  Must not know: which kernels there are.
"""

from __future__ import annotations

import functools
import importlib
import sys
from typing import Any, Final, TypeAlias

import llvmlite.binding

from coordinator.base.kernel_cache import private

_Any: TypeAlias = Any  # numba's own classes, which have no type annotations
_State: TypeAlias = tuple[str, str, tuple[bytes, bytes]]

_LIBRARY: Final[_Any] = private("codegen.JITCodeLibrary")
_ENGINE: Final[_Any] = private("codegen.JitEngine")
_KEPT: Final[_Any] = private("caching.Cache")
_CONTEXT: Final[_Any] = private("cpu.CPUContext")
_CONSTANTS: Final[_Any] = private("environment")
_RUNTIME: Final[_Any] = private("runtime.rtsys")
_RUNTIME_CODE: Final[_Any] = private("runtime.nrt.nrtdynmod")
_COMPILE_RUNTIME: Final = "compile_nrt_functions"

_OF_LIBRARIES: Final = (
    "_unserialize",
    "_get_module_for_linking",
    "_set_compiled_object",
    "_finalize_final_module",
    "enable_object_caching",
    "get_pointer_to_function",
)
_OF_ENGINES: Final = ("_load_defined_symbols", "get_function_address")

_HASH_SECRET: Final = b"_numba_hashsecret"
"""Prefix of the symbols of numba's hash secret; importing numba.cpython.hashing defines them."""


def load_quickly() -> None:
    """Make numba load cached code without its bitcode; change nothing in unknown versions."""
    if _knows(_LIBRARY, *_OF_LIBRARIES) and _knows(_ENGINE, *_OF_ENGINES):
        _put_bitcode_off()
        if _knows(_KEPT, "_load_overload", "_guard_against_spurious_io_errors") and (
            _knows(_RUNTIME, "_init", "initialize") and _knows(_RUNTIME_CODE, _COMPILE_RUNTIME)
        ):
            _put_compiler_off()
    if _knows(_CONSTANTS, "_rebuild_env", "lookup_environment", "Environment"):
        _leave_modules_out()
    if _knows(_CONTEXT, "load_additional_registries"):
        _trust_blas()


def _knows(owner: _Any, *names: str) -> bool:
    """Return whether numba has all the names that are replaced or used here."""
    return all(hasattr(owner, name) for name in names)


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
        if _HASH_SECRET in machine_code:
            importlib.import_module("numba.cpython.hashing")
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


def _put_compiler_off() -> None:
    """Do not initialize the compiler on loading; it initializes itself on compiling."""

    def load_overload(kept: _Any, signature: _Any, context: _Any) -> _Any:
        name_runtime(context)
        with kept._guard_against_spurious_io_errors():
            return kept._load_overload(signature, context)

    @functools.cache
    def name_runtime(context: _Any) -> None:
        """Register numba's reference counting with the linker, without compiling its inline part.

        Cached code already contains that part.  The runtime stays marked as not initialized, so
        that the compiler initializes it when it is needed.
        """
        if _RUNTIME._init:
            return
        compile_functions = getattr(_RUNTIME_CODE, _COMPILE_RUNTIME)
        setattr(_RUNTIME_CODE, _COMPILE_RUNTIME, lambda _context: None)
        try:
            _RUNTIME.initialize(context)
        finally:
            setattr(_RUNTIME_CODE, _COMPILE_RUNTIME, compile_functions)
            _RUNTIME._init = False

    _KEPT.load_overload = load_overload


def _leave_modules_out() -> None:
    """Load the constants of numba's own functions without importing their modules.

    Only code in object mode accesses its module, and kernels are never compiled in object mode.
    """
    whole = _CONSTANTS._rebuild_env

    @functools.wraps(whole)  # cached code refers to this function by name: keep numba's name
    def rebuild(module: str, constants: list[_Any], name: str) -> _Any:
        if not module.startswith("numba.") or module in sys.modules:
            return whole(module, constants, name)
        found = _CONSTANTS.lookup_environment(name)
        if found is None:
            found = _CONSTANTS.Environment({"__name__": module})
            found.consts[:] = constants
            found.env_name = name
            _CONSTANTS.Environment._memo[name] = found
        return found

    _CONSTANTS._rebuild_env = rebuild


def _trust_blas() -> None:
    """Initialize the compiler without its check for BLAS: SciPy is a dependency here."""
    get_ready = _CONTEXT.load_additional_registries

    def get_ready_without_a_look(context: _Any) -> None:
        linalg: _Any = importlib.import_module("numba.np.linalg")
        look = getattr(linalg, "ensure_blas", None)
        linalg.ensure_blas = lambda: None
        try:
            importlib.import_module("numba.np.arraymath")
        finally:
            linalg.ensure_blas = look
        _CONTEXT.load_additional_registries = get_ready
        get_ready(context)

    _CONTEXT.load_additional_registries = get_ready_without_a_look
