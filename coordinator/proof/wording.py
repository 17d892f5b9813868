"""What a proof says, in words for people: the same in tables and pictures.

Decides: the words and units.  Must not know: where they stand.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

_FAULTS: Final = {
    "late": "a late robot",
    "stop": "a dead robot",
    "coordinator": "a lost coordinator",
}

_SMALL: Final = 0.1
"""Distances [m] below this are told in millimetres."""


def survived(names: Iterable[str]) -> str:
    """Return what a plan survives, from the names in its proof."""
    return "survives " + (", ".join(_FAULTS.get(name, name) for name in names) or "no fault")


def slack_of(least: float) -> str:
    """Return how much the tightest pair has beyond what it needs [m]."""
    size = abs(least)
    told = f"{1000.0 * size:.1f} mm" if size < _SMALL else f"{size:.2f} m"
    return f"{told} {'above' if least >= 0.0 else 'below'} its need"
