"""What the coordinator's commands can end with; each text is for the person who ran them."""

from __future__ import annotations

from collections.abc import Sequence


class InputError(Exception):
    """Bad input from a person: every problem found, one line each.  Exit code 2."""

    def __init__(self, problems: Sequence[str]) -> None:
        super().__init__("\n".join(problems))
        self.problems = tuple(problems)


class PlanError(Exception):
    """No plan exists, or none was found: who blocks whom, where, what would help.  Exit code 1.

    `blames`: the robot without which there might be one, if that is known.
    """

    def __init__(self, text: str, blames: str = "") -> None:
        super().__init__(text)
        self.blames = blames


class TurnError(PlanError):
    """A turn is tighter than the robot can make; `radius` [m] is what there is room for."""

    def __init__(self, text: str, radius: float) -> None:
        super().__init__(text)
        self.radius = radius


class CoarseError(PlanError):
    """Float32 numbers are too coarse at that distance from the origin."""


class LogError(Exception):
    """The log could not be written to its end; the text is one sentence.  Exit code 1."""


def unreadable(error: Exception) -> str:
    """Return why text could not be read; Python words numbers of many digits for programmers."""
    return "a number has too many digits" if "int_max_str_digits" in str(error) else str(error)
