"""What is wrong with a VDA 5050 file, found while its parts are read.

Decides: how a problem is worded, file and field first.  Must not know: which parts an order has.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from coordinator.scenario.checks import Quantity, show


class Finder(NamedTuple):
    """Problems of one file."""

    file: str
    problems: list[str]

    def note(self, field: str, problem: str) -> None:
        """Note what is wrong with a field."""
        self.problems.append(f"{self.file}: {field}: {problem}")

    def items(self, table: Mapping[str, Any], key: str, where: str) -> list[Any]:
        """Return a list of an object; an empty one when it is absent or bad, which is noted."""
        value = table.get(key)
        if isinstance(value, list):
            return value
        self.note(where, "is missing" if value is None else f"{show(value)} is not a list")
        return []

    def number(self, value: object, where: str, allowed: Quantity) -> float:
        """Return a number; NaN for a bad one, which is noted."""
        problem = allowed.complaint(value)
        if problem:
            self.note(where, problem)
        return math.nan if problem else float(value)  # type: ignore[arg-type]
