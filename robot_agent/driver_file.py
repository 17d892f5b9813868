"""The driver that `--driver` names: finding, importing and creating it.

Decides: how a driver is named, and the message when it cannot be loaded.  Must not know:
what drivers do.
"""

from __future__ import annotations

import importlib
import importlib.machinery
import importlib.util
import math
import os
import sys
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path
from types import ModuleType
from typing import Final

from robot_agent.driver import Driver

_MODULE: Final = "splinefleet_driver"
"""A driver's file is imported under this name: its own name may be that of a loaded module."""


class DriverNameError(Exception):
    """Raised when the driver that `--driver` names cannot be created; the text is one line."""


def make_driver(name: str, max_accel: float) -> Driver:
    """Create the driver named MODULE:CLASS or FILE.py:CLASS for an acceleration [m/s^2].

    A driver's file may import modules from its own folder; installed modules come first.  An
    acceleration of 0 means that the user gave none.  Raises DriverNameError.
    """
    place, _, wanted = name.rpartition(":")
    if not place or not wanted:
        raise DriverNameError(f"{name!r} is not MODULE:CLASS or FILE.py:CLASS")
    is_file = place.endswith(".py") or os.sep in place
    module = _import(name, (lambda: _run(Path(place))) if is_file else _finder(place))
    if not hasattr(module, wanted):
        found = ", ".join(_classes(module))
        raise DriverNameError(
            f"{name}: no {wanted}, {'it has ' + found if found else 'it has no class'}"
        )
    try:
        made = getattr(module, wanted)(max_accel or math.inf)
    except (Exception, SystemExit) as error:
        raise DriverNameError(f"{name}: {_failure(error)}") from None
    if not isinstance(made, Driver):
        raise DriverNameError(f"{name} is not a Driver")
    return made


def _import(name: str, load: Callable[[], ModuleType]) -> ModuleType:
    try:
        return load()
    except DriverNameError as error:
        raise DriverNameError(f"{name}: {error}") from None
    except (Exception, SystemExit) as error:
        raise DriverNameError(f"{name}: {_failure(error)}") from None


def _finder(module: str) -> Callable[[], ModuleType]:
    def find() -> ModuleType:
        try:
            return importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name is None or not f"{module}.".startswith(f"{error.name}."):
                raise
            hint = f"a file is named as in {module.rpartition('.')[2]}.py:Base"
            raise DriverNameError(f"{_not_found(error)}; {hint}") from None

    return find


def _run(file: Path) -> ModuleType:
    """Import a file and return its module."""
    path = file.absolute()
    if not path.is_file():
        raise DriverNameError(f"no file {path}")
    loader = importlib.machinery.SourceFileLoader(_MODULE, str(path))
    spec = importlib.util.spec_from_file_location(_MODULE, path, loader=loader)
    if spec is None:
        raise DriverNameError(f"{path} is not a Python module")
    sys.path.append(str(path.parent))
    module = sys.modules[_MODULE] = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def _classes(module: ModuleType) -> Iterable[str]:
    """Yield the names of the classes that a module defines and of the drivers that it imports."""
    for name, value in vars(module).items():
        if not isinstance(value, type) or value is Driver:
            continue
        if value.__module__ == module.__name__ or issubclass(value, Driver):
            yield name


def _failure(error: BaseException) -> str:
    """Return in which file and line an import failed, and why."""
    if isinstance(error, SyntaxError):
        file, line = error.filename, error.lineno
    else:
        frame = traceback.extract_tb(error.__traceback__)
        frames = [one for one in frame if not one.filename.startswith(("<frozen ", __file__))]
        if not frames:
            return str(error)
        file, line = frames[-1].filename, frames[-1].lineno
    if isinstance(error, ModuleNotFoundError):
        what = _not_found(error)
    else:
        what = f"{type(error).__name__}: {error.msg if isinstance(error, SyntaxError) else error}"
    return f"{file}, line {line}: {what}"


def _not_found(error: ModuleNotFoundError) -> str:
    """Return which module was not found, and the folders that were searched."""
    parent = (error.name or "").rpartition(".")[0]
    folders = getattr(sys.modules.get(parent), "__path__", None) if parent else sys.path
    if error.name is None or folders is None:
        return str(error)
    places = dict.fromkeys(Path(one).absolute() for one in folders)
    looked = ", ".join(str(one) for one in places if one.is_dir())
    return f"no module {error.name} in {looked}"
