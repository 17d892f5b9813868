"""The errors with which the coordinator's commands can end: their data and their sentences.

No code parses a sentence: it reads the fields.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Self


class InputError(Exception):
    """Invalid input from a person: all problems found, one line each.  Exit code 2."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__("\n".join(problems))
        self.problems = tuple(problems)

    def __reduce__(self) -> tuple[object, ...]:
        """Return how to copy or pickle the error: by its fields."""
        return _with_fields, (type(self), self.args, self.__dict__)


class PartsError(InputError):
    """Some `robots` of a plan have no Plan message, or one that they would not accept."""

    def __init__(self, problems: Sequence[str], robots: Sequence[str]) -> None:
        super().__init__(problems)
        self.robots = tuple(robots)


class PlanError(Exception):
    """No plan exists, or none was found.  Exit code 1.

    reason: what is wrong, without the robot's name.  helps: what would help, "" if unknown.
    robot: the robot that the error concerns, "" if there is no single one.  blames: the robot
    without which a plan might exist; defaults to `robot`.
    place: where the problem is [m], None if it has no place.
    """

    def __init__(
        self,
        reason: str,
        robot: str = "",
        *,
        blames: str = "",
        place: tuple[float, float] | None = None,
        helps: str = "",
    ) -> None:
        super().__init__(reason)
        self.reason = reason
        self.robot = robot
        self.blames = blames or robot
        self.place = place
        self.helps = helps

    def __str__(self) -> str:
        """Return the error in one sentence."""
        return f"{self.robot}: {self.sentence}" if self.robot else self.sentence

    @property
    def sentence(self) -> str:
        """The error in words, without the name of the robot concerned."""
        return f"{self.reason}; {self.helps} would help" if self.helps else self.reason

    def __reduce__(self) -> tuple[object, ...]:
        """Return how to copy or pickle the error: by its fields."""
        return _with_fields, (type(self), self.args, self.__dict__)

    def about(self, robot: str) -> Self:
        """Return a copy of the error that concerns, and blames, this robot."""
        named = copy(self)
        named.robot = named.blames = robot
        return named


def _with_fields(
    kind: type[Exception], args: tuple[object, ...], fields: dict[str, object]
) -> Exception:
    error = kind.__new__(kind, *args)
    error.__dict__.update(fields)
    return error


class TurnError(PlanError):
    """A turn is tighter than the robot can make; there is room for a turn of `radius` [m]."""

    def __init__(
        self, reason: str, radius: float, place: tuple[float, float], helps: str = ""
    ) -> None:
        super().__init__(reason, place=place, helps=helps)
        self.radius = radius


class SeveralRobotsError(PlanError):
    """Several robots have no path, each for a reason of its own: `errors`, one for each robot."""

    def __init__(self, errors: Sequence[PlanError]) -> None:
        super().__init__("\n".join(map(str, errors)), blames=errors[0].blames)
        self.errors = tuple(errors)


class CoarseError(PlanError):
    """Float32 numbers are too coarse at this distance from the origin."""


class ClusterError(Exception):
    """A cluster failed before the work was done; the text is one sentence.  Exit code 1."""


class LogError(Exception):
    """The log could not be written to its end; the text is one sentence.  Exit code 1."""


def unreadable(error: Exception) -> str:
    """Return why text could not be parsed.

    Python's own message about a number with too many digits addresses programmers and is replaced.
    """
    return "a number has too many digits" if "int_max_str_digits" in str(error) else str(error)
