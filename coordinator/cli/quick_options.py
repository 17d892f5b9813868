"""Reads command lines without building the validators that most options do not need.

typer reads every value with a validator of pydantic.  It imports pydantic and builds a validator
for each option of a command, given or not, which takes 80 ms at the start of each process.  Options
that are not given, texts and paths need no validator.  All other values are read as usual, so the
accepted values and the error messages do not change.

Decides: which values need no validator.  Must not know: commands.
"""

from __future__ import annotations

import importlib
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TypeAlias

_Any: TypeAlias = Any  # typer's own classes, which are not public


def _private(module: str, name: str) -> _Any:
    """Return an attribute of a module of typer; None if this version does not have it."""
    with suppress(ImportError):
        return getattr(importlib.import_module(module), name, None)
    return None


_PARAMETER: Final[_Any] = _private("typer.core", "_TyperParameter")
_CHECKED_PATH: Final[_Any] = _private("typer._param_types", "coerce_cli_path")

_NOT_PLAIN: Final = object()


def read_quickly() -> None:
    """Make typer read plain values without validators.

    A version of typer that this module does not know stays as it is.
    """
    if _CHECKED_PATH is None or not hasattr(_PARAMETER, "get_runtime_param"):
        return
    usual = _PARAMETER.get_runtime_param

    class Reader:
        """A replacement for the object that reads values for typer."""

        def coerce(self, value: _Any, param: _Any, ctx: _Any) -> _Any:
            """Return an option's value; raise typer.BadParameter if it is not valid."""
            plain = _plain(value, param, ctx)
            return (
                usual(param).coerce(value, param=param, ctx=ctx) if plain is _NOT_PLAIN else plain
            )

    reader = Reader()
    _PARAMETER.get_runtime_param = lambda _parameter: reader


def _plain(value: _Any, param: _Any, ctx: _Any) -> _Any:
    """Return a text or path unchanged and None or () for an option that is not given.

    Return _NOT_PLAIN for every value that needs a validator.
    """
    info, wanted = param.type_descriptor.parameter_info, param.type_descriptor.annotation
    if value is None:
        return () if param.multiple or param.nargs == -1 else None
    if param.multiple or param.nargs != 1 or info.parser is not None:
        return _NOT_PLAIN
    if wanted is Path and info.path_type is None:
        return Path(_CHECKED_PATH(value, info, path_type=None, param=param, ctx=ctx))
    return value if type(value) is wanted else _NOT_PLAIN
