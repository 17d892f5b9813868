"""A driver found by its name, MODULE:CLASS or FILE.py:CLASS, and made.

Decides: where drivers are looked for, and what is said of one that is not there or does not work.
Must not know: what drivers do.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
import traceback
from pathlib import Path
from types import ModuleType

from robot_agent.driver import Driver


class NoDriverError(Exception):
    """No driver can be had by a name; the text is one sentence for the person who gave it."""


def load_driver(name: str, max_accel: float) -> Driver:
    """Return the driver of a name, made for an acceleration [m/s^2]; inf: it stops at once.

    A file's folder is where its own imports are looked for first, as when Python runs a file.
    Raises NoDriverError.
    """
    place, _, class_name = name.rpartition(":")
    if not place or not class_name:
        raise NoDriverError(f"{name} is neither MODULE:CLASS nor FILE.py:CLASS")
    module = _load(place)
    found = getattr(module, class_name, None)
    if found is None:
        classes = [one for one, it in vars(module).items() if _is_own_class(it, module)]
        has = f"it has {', '.join(classes)}" if classes else "it has no class"
        raise NoDriverError(f"{place} has no {class_name}; {has}")
    try:
        made = found(max_accel)
    except Exception as error:
        raise NoDriverError(f"{name}({max_accel:g}) failed: {_told(error)}") from None
    if not isinstance(made, Driver):
        raise NoDriverError(f"{name} is no robot_agent.driver.Driver")
    return made


def _load(place: str) -> ModuleType:
    try:
        return _from_file(Path(place)) if place.endswith(".py") else importlib.import_module(place)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{place}.".startswith(f"{error.name}."):
            raise NoDriverError(_not_found(place, error.name)) from None
        raise NoDriverError(f"{place} cannot be imported: {_told(error)}") from None
    except NoDriverError:
        raise
    except Exception as error:
        raise NoDriverError(f"{place} cannot be imported: {_told(error)}") from None


def _from_file(file: Path) -> ModuleType:
    if not file.is_file():
        raise NoDriverError(f"{file}: there is no such file in {Path.cwd()}")
    spec = importlib.util.spec_from_file_location(file.stem, file)
    if spec is None or spec.loader is None:
        raise NoDriverError(f"{file} is no Python file")
    sys.path.insert(0, str(file.resolve().parent))
    module = importlib.util.module_from_spec(spec)
    sys.modules[file.stem] = module
    spec.loader.exec_module(module)
    return module


def _not_found(place: str, missing: str) -> str:
    folders = ", ".join(folder or "." for folder in sys.path)
    return (
        f"there is no module {missing} in {folders}; PYTHONPATH adds folders, "
        f"and {place.rpartition('.')[2]}.py:CLASS names a file"
    )


def _told(error: Exception) -> str:
    """Return an error in one line, with the place that it came from."""
    if isinstance(error, SyntaxError):
        return f"SyntaxError: {error.msg} ({error.filename}, line {error.lineno})"
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)
        if "importlib" not in frame.filename and frame.filename != __file__
    ]
    where = "".join(f" ({frame.filename}, line {frame.lineno})" for frame in frames[-1:])
    return f"{type(error).__name__}: {' '.join(str(error).split())}{where}"


def _is_own_class(found: object, module: ModuleType) -> bool:
    return inspect.isclass(found) and found.__module__ == module.__name__
