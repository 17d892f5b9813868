"""The result of a proof in words for people, the same in tables and pictures.

Decides: the words and units.  Must not know: where the words are shown.
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
"""Distances [m] below this are given in millimetres."""


def survived(names: Iterable[str]) -> str:
    """Return in words which faults a plan survives, from the names in its proof."""
    return "survives " + (", ".join(_FAULTS.get(name, name) for name in names) or "no fault")


def slack_of(least: float) -> str:
    """Return in words how far the tightest pair is above or below its need; `least` in [m]."""
    size = abs(least)
    told = f"{1000.0 * size:.1f} mm" if size < _SMALL else f"{size:.2f} m"
    return f"{told} {'above' if least >= 0.0 else 'below'} its need"
