"""Command lines of which all problems are found, not only the first.

Decides: when values are checked, and that a command begins only if all are valid.  Must not know:
the commands, the wording of errors (usage.py).
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from typing import Any, TypeAlias

import typer
from typer.core import TyperCommand, TyperGroup

from coordinator.cli.option_checks import GIVEN

_Resolved: TypeAlias = tuple[str | None, Any, list[str]]


class UsageProblems(typer.BadParameter):
    """Several values of a command line are invalid: `problems`, in the order of the help."""

    def __init__(self, problems: Sequence[typer.BadParameter]) -> None:
        super().__init__("\n".join(one.format_message() for one in problems))
        self.problems = tuple(problems)


class CheckedCommand(TyperCommand):
    """A command that checks all its options and arguments before it reports the invalid ones."""

    def parse_args(self, ctx: typer.Context, args: list[str]) -> list[str]:  # type: ignore[override]
        """Read and check the command line; raise UsageProblems if several values are invalid."""
        if ctx.resilient_parsing:  # A shell completes a line that is not whole yet.
            return super().parse_args(ctx, args)
        try:
            given, rest, _ = self.make_parser(ctx).parse_args(args=list(args))
        except typer.TyperException as error:
            vars(error)["ctx"] = ctx  # The parser leaves it out of some errors.
            raise
        ctx.meta[GIVEN] = frozenset(given)
        ctx.args = list(rest)
        problems: list[typer.BadParameter] = []
        # `--help` goes first: it ends the command whatever else is stated.
        for parameter in sorted(self.get_params(ctx), key=lambda one: not one.is_eager):
            try:
                parameter.handle_parse_result(ctx, given, rest)
            except typer.BadParameter as error:
                problems.append(error)
        if len(problems) > 1:
            raise UsageProblems(problems)
        if problems:
            raise problems[0]
        if rest and not ctx.allow_extra_args:
            ctx.fail(f"Got unexpected extra argument(s) ({' '.join(rest)})")
        return ctx.args


class CommandGroup(TyperGroup):
    """A group of commands that names the nearest one for a name that it does not know."""

    def resolve_command(self, ctx: typer.Context, args: list[str]) -> _Resolved:  # type: ignore[override]
        """Return the command that the arguments begin with, its name and the other arguments."""
        name = args[0]
        is_known = name.startswith("-") or self.get_command(ctx, name) is not None
        if not is_known and not ctx.resilient_parsing:
            known = self.list_commands(ctx)
            (nearest,) = difflib.get_close_matches(name[:40], known, n=1, cutoff=0.0)
            ctx.fail(f"{name[:60]!r} is not a command, the nearest one is {nearest}")
        return super().resolve_command(ctx, args)


def check_all(commands: typer.Typer) -> None:
    """Make all commands of an application, and of the groups in it, check whole command lines."""
    for command in commands.registered_commands:
        command.cls = CheckedCommand
    for group in commands.registered_groups:
        if group.typer_instance is not None:
            check_all(group.typer_instance)
