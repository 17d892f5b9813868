"""Reading one table of a scenario file: it returns checked values and notes problems by field.

Decides: how a value of a file is converted and how an invalid one is reported.  Must not know:
which keys a scenario has (scenario_reader.py, workspace_reader.py).  An invalid value is reported
once and replaced by NaN or an empty value, which later checks ignore: one mistake, one line.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from typing import Any, Final, cast

from coordinator.scenario.checks import COORDINATE, HEADING, Quantity, key_name, show
from coordinator.scenario.model import Point
from protocol.keys import NAME, NAME_IN_WORDS

MOST_PRIORITY: Final = 1_000_000
SHAPES: Final = {2: "[x, y]", 3: "[x, y, heading]", 4: "[x0, y0, x1, y1]"}


class Table:
    """One table of the file; returns checked values and notes problems by the field's full name."""

    def __init__(
        self,
        value: object,
        where: str,
        known: Sequence[str],
        required: Sequence[str],
        problems: list[str],
    ) -> None:
        self.where = where
        self.problems = problems
        self.values: Mapping[str, object] = {}
        self.excused = set(known)
        if not isinstance(value, dict):
            problems.append(f"{where or 'file'}: {show(value)} is not a table")
            return
        self.values = {key: value[key] for key in known if key in value}
        self.excused = set()
        for key in [key for key in value if key not in known]:
            nearest = difflib.get_close_matches(key[:40], known, n=1, cutoff=0.0)[0]
            self.note(key, f"unknown key, the nearest known one is {nearest}")
            self.excused.update(difflib.get_close_matches(key[:40], known, n=1))
        for key in required:
            if key not in self.values and key not in self.excused:
                self.note(key, "is missing")

    def field(self, key: str) -> str:
        """Return the full name of a field."""
        return f"{self.where}.{key_name(key)}" if self.where else key_name(key)

    def note(self, key: str, problem: str) -> None:
        """Add a problem with a field."""
        self.problems.append(f"{self.field(key)}: {problem}")

    def numbers(self, quantities: Mapping[str, Quantity]) -> dict[str, Any]:
        """Return the numbers that the table states; NaN in place of an invalid one."""
        numbers: dict[str, Any] = {}
        for key in [key for key in quantities if key in self.values]:
            value: Any = self.values[key]
            problem = quantities[key].complaint(value)
            if problem:
                self.note(key, problem)
            numbers[key] = math.nan if problem else value if value == "auto" else float(value)
        return numbers

    def name(self, key: str, default: str = "") -> str:
        """Return a name that is valid in keys on the wire; the default if absent or invalid."""
        value = self.values.get(key)
        if isinstance(value, str) and NAME.fullmatch(value):
            return value
        if key in self.values:
            self.note(key, f"{show(value)} is not a name of {NAME_IN_WORDS}")
        return default

    def text(self, key: str) -> str:
        """Return a text; an empty one if it is absent or invalid."""
        value = self.values.get(key, "")
        if isinstance(value, str) and (value or key not in self.values):
            return value
        self.note(key, f"{show(value)} is not a text in quotes")
        return ""

    def whole(self, key: str, least: int, most: int, default: int) -> int:
        """Return an integer within limits; the default if it is absent or invalid."""
        value = self.values.get(key, default)
        if type(value) is int and least <= value <= most:
            return value
        self.note(key, f"{show(value)} is not an integer from {least} to {most}")
        return default

    def items(self, key: str, what: str, most: int | None = None) -> list[object]:
        """Return a list; an empty one if it is absent, invalid or longer than `most`."""
        value = self.values.get(key, [])
        if not isinstance(value, list):
            self.note(key, f"{show(value)} is not a list of {what}")
        elif most is not None and len(value) > most:
            self.note(key, f"{len(value)} {key} are more than {most}")
        else:
            return value
        return []

    def points(self, key: str) -> tuple[Point, ...]:
        """Return a list of places without headings, each all NaN if it is invalid."""
        points = enumerate(self.items(key, "places [[x, y], ...]"))
        return tuple(
            cast(Point, read_place(point, f"{self.field(key)}[{i}]", (2,), self.problems))
            for i, point in points
        )

    def place(self, key: str, *sizes: int) -> tuple[float, ...]:
        """Return a place with one of these numbers of values; all NaN if absent or invalid."""
        if key not in self.values:
            return (math.nan,) * sizes[0]
        return read_place(self.values[key], self.field(key), sizes, self.problems)


def read_place(
    value: object, where: str, sizes: Sequence[int], problems: list[str]
) -> tuple[float, ...]:
    """Return [x, y], [x, y, heading] or [x0, y0, x1, y1], checked; all NaN if it is invalid."""
    bad = (math.nan,) * sizes[0]
    if not isinstance(value, list) or len(value) not in sizes:
        allowed = " or ".join(SHAPES[size] for size in sizes)
        problems.append(f"{where}: {show(value)} is not {allowed}")
        return bad
    quantities = [HEADING if i == 2 and len(value) == 3 else COORDINATE for i in range(len(value))]
    complaints = [q.complaint(number) for q, number in zip(quantities, value, strict=True)]
    problems += [f"{where}[{i}]: {text}" for i, text in enumerate(complaints) if text]
    return bad if any(complaints) else tuple(float(number) for number in value)
