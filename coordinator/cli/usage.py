"""Describes an invalid command line in one line: the option, its value and what is allowed.

Decides: the wording of the errors that Typer finds.  Must not know: the commands.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, Final

import typer
import typer.core

from coordinator.cli.checked_command import UsageProblems

_ARGUMENT: Final = re.compile(r"\{(\w+)\}")
"""An argument without a metavar, as Typer writes it into the usage line."""

_NUMBERS: Final = {"int": "a whole number", "float": "a number", "bool": "yes or no"}
_LIMITS: Final = {
    "greater_than_equal": ("ge", "{} is less than {:g}, the least allowed"),
    "less_than_equal": ("le", "{} is more than {:g}, the most allowed"),
}


def usage_lines(error: typer.TyperException) -> list[str]:
    """Return one line for each problem of a command line; none if Typer has shown the help."""
    problems = error.problems if isinstance(error, UsageProblems) else [error]
    return [line for line in map(usage_line, problems) if line]


def usage_line(error: typer.TyperException) -> str:
    """Return one line for an invalid command line; "" if Typer has shown the help instead."""
    if isinstance(error, typer.BadParameter):
        name = _name(error)
        if type(error).__name__ == "MissingParameter":
            return f"{name} is missing{_usage(error)}"
        problem = _problem(error) + _shape(getattr(error, "param", None))
        return f"{name}: {problem}" if name else problem
    told = _plain(error.format_message())
    option, context = getattr(error, "option_name", None), getattr(error, "ctx", None)
    for known in context.command.params if context is not None else ():
        if option in known.opts:
            return told + _shape(known)
    return told + _usage(error) if told else ""


def _shape(parameter: typer.core.TyperOption | None) -> str:
    """Return how an option with several values is written, as the end of a line."""
    if parameter is None or parameter.nargs < 2:
        return ""
    return f"; it is {max(parameter.opts, key=len)} {parameter.metavar}, separated by spaces"


def _usage(error: typer.TyperException) -> str:
    """Return the command's usage as the end of a line; "" if the command is not known."""
    context = getattr(error, "ctx", None)
    if context is None:
        return ""
    usage = " ".join(context.get_usage().split()).replace("Usage:", "usage:")
    return "; " + _ARGUMENT.sub(lambda found: found[1].upper(), usage)


def _name(error: typer.BadParameter) -> str:
    """Return the option or argument that an error is about, as users write it; "" if none."""
    hint = getattr(error, "param_hint", None)
    if hint is not None:
        return str(hint) if isinstance(hint, str) else str(hint[-1])
    parameter = getattr(error, "param", None)
    if parameter is None:
        return ""
    if parameter.param_type_name == "argument":
        return str(parameter.metavar or parameter.name).upper()
    return str(max(parameter.opts, key=len))


def _problem(error: typer.BadParameter) -> str:
    """Return a description of what is wrong with a value, including the value."""
    found = getattr(error.__cause__, "errors", None)
    if found is None:
        return _plain(error.message)
    problem: Mapping[str, Any] = found()[0]
    kind, value = str(problem["type"]), problem["input"]
    if kind in _LIMITS and not math.isnan(float(value)):
        limit, words = _LIMITS[kind]
        return words.format(value, problem["ctx"][limit])
    wanted = "a number" if kind in _LIMITS else _NUMBERS.get(kind.partition("_")[0])
    if wanted is not None:
        return f"{str(value)[:60]!r} is not {wanted}"
    return _plain(str(problem["msg"]).removeprefix("Value error, "))


def _plain(text: str) -> str:
    """Return a text on one line, without its full stop."""
    return " ".join(text.split()).removesuffix(".")
