"""Collects the problems of a VDA 5050 file while its parts are read.

Decides: the form of a problem, which begins with file and field.  Must not know: which parts an
order has.
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
        """Note a problem of a field."""
        self.problems.append(f"{self.file}: {field}: {problem}")

    def items(self, table: Mapping[str, Any], key: str, where: str) -> list[Any]:
        """Return the list under a key; note a missing or invalid one and return an empty list."""
        value = table.get(key)
        if isinstance(value, list):
            return value
        self.note(where, "is missing" if value is None else f"{show(value)} is not a list")
        return []

    def number(self, value: object, where: str, allowed: Quantity) -> float:
        """Return a number; note an invalid one and return NaN."""
        problem = allowed.complaint(value)
        if problem:
            self.note(where, problem)
        return math.nan if problem else float(value)  # type: ignore[arg-type]
