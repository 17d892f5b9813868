"""The driver that `--driver` names: found, imported, made; or what was looked for, and where.

Decides: how a driver is named, and what is told of one that does not work.  Must not know: what
drivers do.
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
"""A driver's file is imported by this name: its own may be that of a module in use."""


class DriverNameError(Exception):
    """No driver can be made of what `--driver` names; the text says why, in one line."""


def make_driver(name: str, max_accel: float) -> Driver:
    """Return the driver named MODULE:CLASS or FILE.py:CLASS, made for an acceleration [m/s^2].

    Modules beside a file are found too, after those that are installed.  Without an acceleration
    (0) it is made for any.  Raises DriverNameError.
    """
    place, _, wanted = name.rpartition(":")
    if not place or not wanted:
        raise DriverNameError(f"{name!r} is not MODULE:CLASS or FILE.py:CLASS")
    is_file = place.endswith(".py") or os.sep in place
    module = _import(name, (lambda: _run(Path(place))) if is_file else _finder(place))
    if not hasattr(module, wanted):
        found = ", ".join(_classes(module))
        raise DriverNameError(
            f"{name}: no {wanted}, {'there are ' + found if found else 'nor any class'}"
        )
    try:
        made = getattr(module, wanted)(max_accel or math.inf)
    except (Exception, SystemExit) as error:
        raise DriverNameError(f"{name}: {_failure(error)}") from None
    if not isinstance(made, Driver):
        raise DriverNameError(f"{name} is no Driver")
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
    """Return the module that a file makes."""
    path = file.absolute()
    if not path.is_file():
        raise DriverNameError(f"no file {path}")
    loader = importlib.machinery.SourceFileLoader(_MODULE, str(path))
    spec = importlib.util.spec_from_file_location(_MODULE, path, loader=loader)
    if spec is None:
        raise DriverNameError(f"{path} is no module")
    sys.path.append(str(path.parent))
    module = sys.modules[_MODULE] = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module


def _classes(module: ModuleType) -> Iterable[str]:
    """Name the classes that a module defines, and the drivers that it imports."""
    for name, value in vars(module).items():
        if not isinstance(value, type) or value is Driver:
            continue
        if value.__module__ == module.__name__ or issubclass(value, Driver):
            yield name


def _failure(error: BaseException) -> str:
    """Say in which file and line an import failed, and why."""
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
    """Say which module was not found, and in which folders it was looked for."""
    parent = (error.name or "").rpartition(".")[0]
    folders = getattr(sys.modules.get(parent), "__path__", None) if parent else sys.path
    if error.name is None or folders is None:
        return str(error)
    places = dict.fromkeys(Path(one).absolute() for one in folders)
    looked = ", ".join(str(one) for one in places if one.is_dir())
    return f"no module {error.name} in {looked}"
