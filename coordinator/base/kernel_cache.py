"""Where the machine code of compiled kernels is kept on disk.

Two folders are looked through in turn, and the first that can be written gets what is new: the
`__pycache__` of the package, where set-up compiles for all users, and `splinefleet` in the user's
own cache folder ($XDG_CACHE_HOME, else ~/.cache).  Where neither can be written, code is kept for
the length of the process.

Code lies there under a digest of what it was made from: the kernel's file, all files of ours that
it imports, directly or not, numba's version and the processor.  numba by itself notices only
changes of the file that a kernel is in, and takes a file with another date for another file.

Decides: where kept code is read and written, when it is out of date, and how numba's private names
are asked for.  Must not know: which kernels there are.
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

_Any: TypeAlias = Any  # numba's own classes, which have no types

_ROOT: Final = Path(__file__).parents[__name__.count(".")]
_PACKAGES: Final = ("coordinator", "protocol")
_CONFIG: Final[_Any] = numba.config
_MODE: Final = 0o755  # whatever the umask, nobody else may put code there
_FIRST_DEFINITION: Final = re.compile(r"^(?:@|def |class )", re.MULTILINE)


def private(path: str) -> _Any:
    """Return what numba.core calls by a dotted name; None where this numba does not.

    Such names may change with any release, so who uses one goes without where it is not there.
    """
    core: _Any = numba.core
    return functools.reduce(lambda owner, name: getattr(owner, name, None), path.split("."), core)


_FUNCTION_CACHE: Final[_Any] = private("caching.FunctionCache")
_IMPLEMENTATION: Final[_Any] = private("caching.CompileResultCacheImpl")

_UNREADABLE: Final = (OSError, EOFError, pickle.UnpicklingError)
"""What reading a file raises that is not there, may not be read, or was cut short by a crash."""

_files: Final[set[Path]] = set()
"""The files whose kernels have been asked for."""

_kernels: Final[set[tuple[Path, str]]] = set()
"""The kernels themselves: a file, and how the names of all files begin that a kernel is kept in."""


def keep(kernel: _Any) -> None:
    """Have numba look for a kernel's machine code, and keep it, in the folders named above.

    A numba that has not the classes for that is told one folder, which it can use if it may write
    there.
    """
    code = kernel.py_func.__code__
    file = Path(code.co_filename)
    _files.add(file)
    _kernels.add((file, f"{file.stem}.{kernel.py_func.__qualname__}-{code.co_firstlineno}."))
    if _takes_ours(kernel):
        kernel._cache = KernelCache(kernel.py_func)
    elif (place := writable_place()) is not None:
        _CONFIG.CACHE_DIR = str(place / _name(file))
        kernel.enable_caching()


def _takes_ours(kernel: _Any) -> bool:
    """Tell whether this numba has all that is replaced or relied on here."""
    needed = (
        (_FUNCTION_CACHE, "_impl_class"),
        (_IMPLEMENTATION, "_locator_classes"),
        (kernel, "_cache"),
    )
    return all(hasattr(owner, name) for owner, name in needed)


def is_filled() -> bool:
    """Tell whether each file whose kernels were asked for seems to have been compiled before."""
    return all(any(_holds_code(place / _name(file)) for place in places()) for file in _files)


def count_kernels() -> tuple[int, int]:
    """Return how many of the kernels that were asked for are kept, and how many there are."""
    kept = {
        code.name
        for place in places()
        for folder in {_name(file) for file, _ in _kernels}
        for code in (place / folder).glob("**/*.nbc")
    }
    count = sum(any(name.startswith(begin) for name in kept) for _, begin in _kernels)
    return count, len(_kernels)


def places() -> tuple[Path, ...]:
    """Return the folders in which kept code is looked for, in turn.

    The user's own is left out where nobody knows a home, and where somebody else could have put
    code into it.
    """
    beside = _ROOT / _PACKAGES[0] / "__pycache__"
    with suppress(RuntimeError):  # this user has no home
        own = _user_cache() / "splinefleet"
        if _is_ours_alone(own):
            return beside, own
    return (beside,)


def writable_place() -> Path | None:
    """Return the first folder in which code can be kept, None when there is none."""
    for place in places():
        with suppress(OSError):
            place.mkdir(_MODE, parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=place).close()
            return place
    return None


class KernelCache:
    """What numba asks for a function's machine code before it compiles, and hands it to after."""

    def __init__(self, function: Callable[..., object]) -> None:
        self._function = function

    @functools.cached_property
    def _caches(self) -> list[_Any]:
        """Return numba's cache of the function in each folder; made late, for it reads sources."""
        return [cache(self._function) for cache in _cache_classes()]

    @property
    def cache_path(self) -> str:
        """Return the first folder that is looked into."""
        return str(self._caches[0].cache_path)

    def load_overload(self, signature: _Any, context: _Any) -> _Any:
        """Return kept code for a signature, None when there is none that can be read."""
        for cache in self._caches:
            with suppress(*_UNREADABLE):
                found = cache.load_overload(signature, context)
                if found is not None:
                    return found
        return None

    def save_overload(self, signature: _Any, code: _Any) -> None:
        """Keep code in the first folder that takes it; the process has it in any case.

        numba numbers the files of a kernel by what its index tells: two processes must not do so
        at once, or one's code would be found under the other's signature.
        """
        for cache in self._caches:
            with suppress(*_UNREADABLE), _alone_in(Path(cache.cache_path)):
                cache.save_overload(signature, code)
                return


@contextmanager
def _alone_in(folder: Path) -> Iterator[None]:
    """Keep other processes from writing into a folder meanwhile; make it when it is missing."""
    _make(folder)
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


def _make(folder: Path) -> None:
    """Make a folder of kernels and those above it; OSError when that cannot be done."""
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
        """Make the folder; OSError when that cannot be done."""
        _make(self._folder)

    def get_cache_path(self) -> str:
        """Return the folder."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return what tells whether code is out of date: nothing, the folder's name does."""
        return ""

    def get_disambiguator(self) -> str:
        """Return what tells functions of one name in a file apart."""
        return str(self._line)


@functools.cache
def _cache_classes() -> list[_Any]:
    """Return numba's class of caches, made for each of the folders."""
    classes = []
    for place in places():
        locator = type("Locator", (_Locator,), {"place": place})
        of_results = {"_locator_classes": [locator]}
        implementation = type("Implementation", (_IMPLEMENTATION,), of_results)
        kept = {"_impl_class": implementation}
        classes.append(type("FolderCache", (_FUNCTION_CACHE,), kept))
    return classes


def _holds_code(folder: Path) -> bool:
    return any(folder.glob("**/*.nbc"))


def _user_cache() -> Path:
    """Return the folder of the user's caches; RuntimeError when nobody knows this user's home."""
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return given if given.is_absolute() else Path.home() / ".cache"


def _is_ours_alone(folder: Path) -> bool:
    """Tell whether only this user can have put code into a folder, which may be yet to be made."""
    try:
        found = folder.stat()
    except OSError:
        return True
    return found.st_uid == os.geteuid() and not found.st_mode & 0o022


@functools.cache
def _name(file: Path) -> str:
    """Return the name of the folder of a file's kernels, which tells what they were made from."""
    digest = hashlib.sha256(_made_by().encode())
    for source in sources_of(file):
        digest.update(_content(source))
    return f"kernels-{digest.hexdigest()[:16]}"


@functools.cache
def _made_by() -> str:
    """Return which numba compiles, and for which processor."""
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
    """Return a file and all files of our packages that it imports, directly or not."""
    found, waiting = {file}, [file]
    while waiting:
        for source in _imported(waiting.pop()):
            if source not in found:
                found.add(source)
                waiting.append(source)
    return tuple(sorted(found))


@functools.cache
def _imported(file: Path) -> frozenset[Path]:
    """Return the files of ours that a file imports, with `import` or `from`, dots or not."""
    return frozenset(
        source
        for node in ast.walk(_head(file))
        for folder, parts in _names(node, file)
        if (source := _source(folder, parts)) is not None
    )


def _head(file: Path) -> ast.Module:
    """Return what stands above a file's first definition: all its imports, in a tenth of the time.

    Where that does not parse, as when a docstring looks like a definition, it is the whole file.
    """
    text = file.read_text(encoding="utf-8")
    try:
        return ast.parse(_FIRST_DEFINITION.split(text, maxsplit=1)[0])
    except SyntaxError:
        return ast.parse(text)


def _names(node: ast.AST, file: Path) -> Iterator[tuple[Path, Sequence[str]]]:
    """Yield what a statement imports as dotted names and the folders that these count from."""
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
    """Return the file of a module or package, None when there is none."""
    tried = (path.with_name(f"{path.name}.py"), path / "__init__.py")
    return next((file for file in tried if file.is_file()), None)


def _source(folder: Path, parts: Sequence[str]) -> Path | None:
    """Return the file of a dotted name, or else of the module that the name's last part is in."""
    if folder == _ROOT and parts[0] not in _PACKAGES:
        return None
    return _module(folder.joinpath(*parts)) or _module(folder.joinpath(*parts[:-1]))
