"""Sorts the edges or nodes of a VDA 5050 order by their sequenceId.

Decides: the wording for an invalid sequenceId.  Must not know: what else edges or nodes contain.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from coordinator.exchange.vda5050_finder import Finder
from coordinator.scenario.checks import show

Named = tuple[str, Mapping[str, Any]]
"""The place of an edge or node in its file, for messages, and the edge or node itself."""


def in_sequence(named: list[Named], found: Finder) -> list[Named]:
    """Return edges or nodes sorted by sequenceId, or as they are if none has one.

    Note each missing or invalid sequenceId if others have one.
    """
    if all(edge.get("sequenceId") is None for _, edge in named):
        return named
    places: dict[int, str] = {}
    for where, edge in named:
        number = edge.get("sequenceId")
        if type(number) is not int or number < 0:
            what = "is missing" if number is None else f"{show(number)} is not a whole number"
            found.note(f"{where}.sequenceId", what)
        elif number in places:
            found.note(f"{where}.sequenceId", f"{number} is also that of {places[number]}")
        else:
            places[number] = where
    known = {where: number for number, where in places.items()}
    return sorted(named, key=lambda one: known.get(one[0], -1))
