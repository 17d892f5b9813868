"""Callbacks that check the values of options and arguments before a command begins.

Decides: which values are accepted, and the wording of each problem.  Must not know: commands.
`checked_command.py` calls all callbacks of a command and reports every problem at once, so a check
belongs here, not in the command's body.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Final, TypeVar

import typer

from protocol.endpoint import endpoint_of
from protocol.keys import NAME, NAME_IN_WORDS
from protocol.messages import FARTHEST
from protocol.transport import TransportError

Value = TypeVar("Value")

GIVEN: Final = "splinefleet.given"
"""Key of a context's `meta` under which CheckedCommand keeps the names of the parameters given."""

_SCHEDULER: Final = re.compile(r"(tcp|tls)://(\[[0-9A-Fa-f:.]+\]|[\w.-]+):\d{1,5}")

_SHAPES: Final = {2: "X,Y", 3: "X,Y,HEADING"}


def within(least: float, most: float = math.inf) -> Callable[[float], float]:
    """Return a callback that accepts an option's finite numbers from `least` to `most`."""

    def check(value: float) -> float:
        if not (math.isfinite(value) and least <= value <= most):
            high = f" to {most:g}" if most < math.inf else ""
            raise typer.BadParameter(f"{value} is not a finite number from {least:g}{high}")
        return value

    return check


def if_given(check: Callable[[Value], Value]) -> Callable[[Value | None], Value | None]:
    """Return a callback that applies `check` to the value of an option that may be absent."""

    def check_given(value: Value | None) -> Value | None:
        return None if value is None else check(value)

    return check_given


def one_of(*known: str) -> Callable[[list[str] | None], list[str] | None]:
    """Return a callback that accepts a repeatable option if all its values are among `known`."""

    def check(names: list[str] | None) -> list[str] | None:
        if unknown := [name for name in names or [] if name not in known]:
            raise typer.BadParameter(f"{', '.join(unknown)} is not one of {', '.join(known)}")
        return names

    return check


def writable(*suffixes: str) -> Callable[[Path | None], Path | None]:
    """Return a callback that accepts a file with one of the suffixes in an existing folder.

    Without suffixes it accepts any.
    """

    def check(path: Path | None) -> Path | None:
        if path is None:
            return None
        if suffixes and path.suffix.lower() not in suffixes:
            raise typer.BadParameter(f"{path} does not end in {' or '.join(suffixes)}")
        if not path.parent.is_dir():
            raise typer.BadParameter(f"{path}: there is no folder {path.parent}")
        return path

    return check


def named(name: str | None) -> str | None:
    """Accept the name of a robot, a fleet, an order or a closed place."""
    if name is not None and not NAME.fullmatch(name):
        raise typer.BadParameter(f"{name[:60]!r} is not {NAME_IN_WORDS}")
    return name


def reached(endpoint: str | None) -> str | None:
    """Accept a well-formed endpoint; whether it suits the keys is decided when it is opened."""
    if endpoint is not None:
        try:
            endpoint_of(endpoint, locked=endpoint.startswith("tls/"))
        except TransportError as error:
            raise typer.BadParameter(str(error)) from None
    return endpoint


def cluster_at(address: str | None) -> str | None:
    """Accept the address of a Dask scheduler."""
    if address is not None and not _SCHEDULER.fullmatch(address):
        raise typer.BadParameter(f"{address[:60]!r} is not tcp://HOST:PORT or tls://HOST:PORT")
    return address


def numbers_of(text: str, *counts: int) -> tuple[float, ...]:
    """Return the numbers of a place, separated by commas; there must be one of these counts."""
    try:
        found = tuple(float(part) for part in text.split(","))
    except ValueError:
        found = ()
    if len(found) not in counts or not all(abs(one) <= FARTHEST for one in found):
        shape = " or ".join(_SHAPES[count] for count in counts)
        raise typer.BadParameter(
            f"{text[:60]!r} is not {shape} without spaces, each from {-FARTHEST:g} to {FARTHEST:g}"
        )
    return found


def place_of(*counts: int) -> Callable[[str | None], str | None]:
    """Return a callback that accepts a place, as `numbers_of` reads it."""

    def check(text: str | None) -> str | None:
        if text is not None:
            numbers_of(text, *counts)
        return text

    return check


def given(context: typer.Context, *names: str) -> bool:
    """Return whether the command line states one of these parameters."""
    return not context.meta.get(GIVEN, frozenset()).isdisjoint(names)


def only_with(
    *others: str, check: Callable[[Value], Value] | None = None
) -> Callable[[typer.Context, typer.CallbackParam, Value], Value]:
    """Return a callback that refuses an option that would be ignored without one of the `others`.

    `others`: the names of parameters.  `check` looks at the value first.
    """

    def checked(context: typer.Context, param: typer.CallbackParam, value: Value) -> Value:
        value = value if check is None else check(value)
        if given(context, str(param.name)) and not given(context, *others):
            raise typer.BadParameter(f"has no effect without {_options(context, *others)}")
        return value

    return checked


def not_with(
    *others: str, why: str = "", check: Callable[[Value], Value] | None = None
) -> Callable[[typer.Context, typer.CallbackParam, Value], Value]:
    """Return a callback that refuses an option beside one of the `others`; `why`: the reason."""

    def checked(context: typer.Context, param: typer.CallbackParam, value: Value) -> Value:
        beside = [other for other in others if given(context, other)]
        if given(context, str(param.name)) and beside:
            raise typer.BadParameter(f"not together with {_options(context, *beside)}{why}")
        return value if check is None else check(value)

    return checked


def _options(context: typer.Context, *names: str) -> str:
    """Return the options of these names as users write them."""
    found = [one for one in context.command.params if one.name in names]
    return " or ".join(max(one.opts, key=len) for one in found)
