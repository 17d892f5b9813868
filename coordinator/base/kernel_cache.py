"""The disk cache of the machine code of compiled kernels.

Two folders are searched in turn, and new code is written to the first that is writable: the
`__pycache__` of the package, where set-up compiles for all users, and `splinefleet` in the user's
own cache folder ($XDG_CACHE_HOME, else ~/.cache).  If neither is writable, code lasts only as long
as the process.

The name of a kernel's subfolder contains a digest of all that its code depends on: the kernel's
file, all files of this project that it imports, directly or not, numba's version and the processor.
numba's own cache notices only changes of the file that contains the kernel, and treats a file with
another date as changed.

Decides: where cached code is read and written, when it is out of date, and how numba's private
names are looked up.  Must not know: which kernels there are.
"""

from __future__ import annotations

import ast
import fcntl
import functools
import hashlib
import os
import pickle
import re
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, TypeAlias

import llvmlite.binding
import numba

_Any: TypeAlias = Any  # numba's own classes, which have no type annotations

_ROOT: Final = Path(__file__).parents[__name__.count(".")]
_PACKAGES: Final = ("coordinator", "protocol")
_CONFIG: Final[_Any] = numba.config
_MODE: Final = 0o755  # whatever the umask, nobody else may put code there
_FIRST_DEFINITION: Final = re.compile(r"^(?:@|def |class )", re.MULTILINE)


def private(path: str) -> _Any:
    """Return the object with this dotted name in numba.core; None if this numba has none.

    Private names may change with any release, so callers must work without them.
    """
    core: _Any = numba.core
    return functools.reduce(lambda owner, name: getattr(owner, name, None), path.split("."), core)


_FUNCTION_CACHE: Final[_Any] = private("caching.FunctionCache")
_IMPLEMENTATION: Final[_Any] = private("caching.CompileResultCacheImpl")

_UNREADABLE: Final = (OSError, EOFError, pickle.UnpicklingError)
"""Errors on reading a file that is missing, not readable, or truncated by a crash."""


_kernels: Final[set[tuple[Path, str]]] = set()
"""The kernels passed to `keep`: the file of each, and how the names of its cache files begin."""


def keep(kernel: _Any) -> None:
    """Make numba load and save a kernel's machine code in the folders named above.

    If numba lacks a class or name that this needs, only the first writable folder is used.
    """
    code = kernel.py_func.__code__
    file = Path(code.co_filename)
    _kernels.add((file, f"{file.stem}.{kernel.py_func.__qualname__}-{code.co_firstlineno}."))
    if _takes_ours(kernel):
        kernel._cache = KernelCache(kernel.py_func)
    elif (place := writable_place()) is not None:
        _CONFIG.CACHE_DIR = str(place / _name(file))
        kernel.enable_caching()


def _takes_ours(kernel: _Any) -> bool:
    """Tell whether this numba has all the names that are replaced or used here."""
    needed = (
        (_FUNCTION_CACHE, "_impl_class"),
        (_IMPLEMENTATION, "_locator_classes"),
        (kernel, "_cache"),
    )
    return all(hasattr(owner, name) for owner, name in needed)


def is_filled() -> bool:
    """Return whether the cache holds code for each kernel that was passed to `keep`."""
    count, known = count_kernels()
    return count == known


def count_kernels() -> tuple[int, int]:
    """Return how many of the kernels passed to `keep` are in the cache, and how many there are."""
    kept = {
        code.name
        for place in places()
        for folder in {_name(file) for file, _ in _kernels}
        for code in (place / folder).glob("**/*.nbc")
    }
    count = sum(any(name.startswith(begin) for name in kept) for _, begin in _kernels)
    return count, len(_kernels)


def places() -> tuple[Path, ...]:
    """Return the folders that are searched for cached code, in order.

    The folder in the user's own cache is omitted if the user has no home directory, or if somebody
    else could have written to that folder.
    """
    beside = _ROOT / _PACKAGES[0] / "__pycache__"
    with suppress(RuntimeError):  # this user has no home directory
        own = _user_cache() / "splinefleet"
        if _is_ours_alone(own):
            return beside, own
    return (beside,)


def writable_place() -> Path | None:
    """Return the first folder that is writable, or None if there is none."""
    for place in places():
        with suppress(OSError):
            place.mkdir(_MODE, parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=place).close()
            return place
    return None


class KernelCache:
    """The cache that numba queries before it compiles a function, and fills afterwards."""

    def __init__(self, function: Callable[..., object]) -> None:
        self._function = function

    @functools.cached_property
    def _caches(self) -> list[_Any]:
        """Numba's cache of the function in each folder; made on first use: it reads sources."""
        return [cache(self._function) for cache in _cache_classes()]

    @property
    def cache_path(self) -> str:
        """Return the first folder that is searched."""
        return str(self._caches[0].cache_path)

    def load_overload(self, signature: _Any, context: _Any) -> _Any:
        """Return cached code for a signature, or None if there is none that can be read."""
        for cache in self._caches:
            with suppress(*_UNREADABLE):
                found = cache.load_overload(signature, context)
                if found is not None:
                    return found
        return None

    def save_overload(self, signature: _Any, code: _Any) -> None:
        """Save code in the first folder that can be written; the process uses it in any case.

        numba numbers the files of a kernel by its index.  Two processes must not do this at the
        same time, or the code of one would be stored under the signature of the other.
        """
        for cache in self._caches:
            with suppress(*_UNREADABLE), _alone_in(Path(cache.cache_path)):
                cache.save_overload(signature, code)
                return


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Lock a folder against other processes during the block; make the folder if it is missing."""
    _make(folder)
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _make(folder: Path) -> None:
    """Make a folder of kernels and its parents; raises OSError if that is impossible."""
    folder.parent.mkdir(_MODE, parents=True, exist_ok=True)
    folder.mkdir(_MODE, exist_ok=True)


class _Locator:
    """Tells numba where a function's code lies below `place`."""

    place: Path

    def __init__(self, function: Callable[..., object], file: str) -> None:
        self._folder = self.place / _name(Path(file))
        self._line = function.__code__.co_firstlineno

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> _Locator:
        """Return the locator of a function."""
        return cls(function, file)

    def ensure_cache_path(self) -> None:
        """Make the folder; raises OSError if that is impossible."""
        _make(self._folder)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return the stamp that dates the sources: empty, as the folder's name has a digest."""
        return ""

    def get_disambiguator(self) -> str:
        """Return what distinguishes functions of the same name in one file: the line number."""
        return str(self._line)


@functools.cache
def _cache_classes() -> list[_Any]:
    """Return one subclass of numba's FunctionCache for each of the folders."""
    classes = []
    for place in places():
        locator = type("Locator", (_Locator,), {"place": place})
        of_results = {"_locator_classes": [locator]}
        implementation = type("Implementation", (_IMPLEMENTATION,), of_results)
        kept = {"_impl_class": implementation}
        classes.append(type("FolderCache", (_FUNCTION_CACHE,), kept))
    return classes


def _user_cache() -> Path:
    """Return the user's cache folder; raises RuntimeError if the user has no home directory."""
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return given if given.is_absolute() else Path.home() / ".cache"


def _is_ours_alone(folder: Path) -> bool:
    """Tell whether only this user can have written to a folder; True if it does not exist yet."""
    try:
        found = folder.stat()
    except OSError:
        return True
    return found.st_uid == os.geteuid() and not found.st_mode & 0o022


@functools.cache
def _name(file: Path) -> str:
    """Return the name of the subfolder for a file's kernels; it contains the digest."""
    digest = hashlib.sha256(_made_by().encode())
    for source in sources_of(file):
        digest.update(_content(source))
    return f"kernels-{digest.hexdigest()[:16]}"


@functools.cache
def _made_by() -> str:
    """Return the version of numba and the processor that it compiles for."""
    name, features = _CONFIG.CPU_NAME, _CONFIG.CPU_FEATURES
    if name is None:
        name = llvmlite.binding.get_host_cpu_name()
    if features is None:
        features = llvmlite.binding.get_host_cpu_features().flatten()
    return f"{numba.__version__} {name} {features}"


@functools.cache
def _content(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest()


def sources_of(file: Path) -> tuple[Path, ...]:
    """Return a file and all files of this project's packages that it imports, directly or not."""
    found, waiting = {file}, [file]
    while waiting:
        for source in _imported(waiting.pop()):
            if source not in found:
                found.add(source)
                waiting.append(source)
    return tuple(sorted(found))


@functools.cache
def _imported(file: Path) -> frozenset[Path]:
    """Return the files of this project that a file imports directly, by any form of import."""
    return frozenset(
        source
        for node in ast.walk(_head(file))
        for folder, parts in _names(node, file)
        if (source := _source(folder, parts)) is not None
    )


def _head(file: Path) -> ast.Module:
    """Parse a file down to its first definition, which includes all its imports.

    This takes a tenth of the time of parsing the whole file.  The whole file is parsed if its
    beginning alone is not valid, as when a line of a docstring looks like a definition.
    """
    text = file.read_text(encoding="utf-8")
    try:
        return ast.parse(_FIRST_DEFINITION.split(text, maxsplit=1)[0])
    except SyntaxError:
        return ast.parse(text)


def _names(node: ast.AST, file: Path) -> Iterator[tuple[Path, Sequence[str]]]:
    """Yield for each imported name its base folder, and the name split at its dots."""
    if isinstance(node, ast.Import):
        for one in node.names:
            yield _ROOT, one.name.split(".")
    if isinstance(node, ast.ImportFrom):
        folder = file.parents[node.level - 1] if node.level else _ROOT
        package = node.module.split(".") if node.module else []
        for one in node.names:
            yield folder, [*package, one.name]


@functools.cache
def _module(path: Path) -> Path | None:
    """Return the file of a module or package, or None if there is none."""
    tried = (path.with_name(f"{path.name}.py"), path / "__init__.py")
    return next((file for file in tried if file.is_file()), None)


def _source(folder: Path, parts: Sequence[str]) -> Path | None:
    """Return the file of a dotted name, or of the module that defines the name's last part."""
    if folder == _ROOT and parts[0] not in _PACKAGES:
        return None
    return _module(folder.joinpath(*parts)) or _module(folder.joinpath(*parts[:-1]))
