"""Command lines read without building what only unusual values need.

typer reads every value with a validator of pydantic's, which it imports and builds for each option
of a command, given or not: 80 ms of a process's start.  Options that are not given, texts and paths
need none.  Whatever else is given goes the usual way, so what is taken and what is said stay.

Decides: which values need no validator.  Must not know: commands.
"""

from __future__ import annotations

import importlib
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TypeAlias

_Any: TypeAlias = Any  # typer's own classes, which are not public


def _private(module: str, name: str) -> _Any:
    """Return what a module of typer calls by a name, None in a typer that does not."""
    with suppress(ImportError):
        return getattr(importlib.import_module(module), name, None)
    return None


_PARAMETER: Final[_Any] = _private("typer.core", "_TyperParameter")
_CHECKED_PATH: Final[_Any] = _private("typer._param_types", "coerce_cli_path")

_NOT_PLAIN: Final = object()


def read_quickly() -> None:
    """Have plain values read without validators; an unknown typer is left as it is."""
    if _CHECKED_PATH is None or not hasattr(_PARAMETER, "get_runtime_param"):
        return
    usual = _PARAMETER.get_runtime_param

    class Reader:
        """What typer asks for a value."""

        def coerce(self, value: _Any, param: _Any, ctx: _Any) -> _Any:
            """Return an option's value; raises typer.BadParameter."""
            plain = _plain(value, param, ctx)
            return (
                usual(param).coerce(value, param=param, ctx=ctx) if plain is _NOT_PLAIN else plain
            )

    reader = Reader()
    _PARAMETER.get_runtime_param = lambda _parameter: reader


def _plain(value: _Any, param: _Any, ctx: _Any) -> _Any:
    """Return the value of an option that is not given or is a text or a path, else _NOT_PLAIN."""
    info, wanted = param.type_descriptor.parameter_info, param.type_descriptor.annotation
    if value is None:
        return () if param.multiple or param.nargs == -1 else None
    if param.multiple or param.nargs != 1 or info.parser is not None:
        return _NOT_PLAIN
    if wanted is Path and info.path_type is None:
        return Path(_CHECKED_PATH(value, info, path_type=None, param=param, ctx=ctx))
    return value if type(value) is wanted else _NOT_PLAIN
