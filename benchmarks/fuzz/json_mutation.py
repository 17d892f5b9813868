"""Mutation of JSON: a value is changed, moved, doubled or removed.

Decides: which values are worth trying.  Must not know: what the document means.
"""

from __future__ import annotations

import json
from random import Random
from typing import Any, Final

_VALUES: Final[tuple[Any, ...]] = (
    None, True, False, 0, -1, 1, 2, 3, 255, 2**31, 2**32, 2**63, 2**64, 10**30, -0.0, 1e-300, 1e-9,
    0.5, 1e9, 1e308, -1e308, float("inf"), float("nan"), "", "inf", "R1", "\n", "\ud800", "x" * 100,
    [], {}, [[]], [0.0, 0.0], [None],
)  # fmt: skip
_DEEP: Final = 1_500
_DEEP_SHARE: Final = 0.002


def mutated(data: bytes, seed: int) -> bytes:
    """Return a document with one to three changes; no bytes when `data` is not JSON."""
    dice = Random(seed)
    try:
        document = json.loads(data)
    except (ValueError, RecursionError):
        return b""
    if dice.random() < _DEEP_SHARE:
        return b"[" * _DEEP + data + b"]" * _DEEP
    holder = [document]
    for _ in range(dice.randint(1, 3)):
        places = list(_places(holder))
        _change(*dice.choice(places), dice, places)
    try:
        return json.dumps(holder[0]).encode("utf-8", "surrogatepass")
    except (ValueError, RecursionError):
        return b""


Place = tuple[Any, Any]
"""A list or table, and the index or key in it."""


def _places(value: Any) -> list[Place]:  # noqa: ANN401
    """Return every place in a document, inner ones last."""
    found, waiting = [], [value]
    while waiting:
        holder = waiting.pop()
        names = holder.keys() if isinstance(holder, dict) else range(len(holder))
        for name in names:
            found.append((holder, name))
            if isinstance(holder[name], list | dict):
                waiting.append(holder[name])
    return found


def _change(holder: Any, name: Any, dice: Random, places: list[Place]) -> None:  # noqa: ANN401
    value = holder[name]
    match dice.randrange(6):
        case 0:
            holder[name] = _copy(dice.choice(_VALUES))
        case 1 if isinstance(value, int | float) and not isinstance(value, bool):
            holder[name] = value * dice.choice((-1, 0, 0.5, 1.001, 2, 1000, 1e-9)) + dice.gauss(
                0.0, 0.1
            )
        case 2 if isinstance(holder, dict) or len(holder) > 1:
            del holder[name]
        case 3 if isinstance(holder, list):
            holder.insert(name, _copy(value))
        case 4:
            other, place = dice.choice(places)
            if isinstance(place, str) or place < len(other):
                holder[name] = _copy(other.get(place) if isinstance(other, dict) else other[place])
        case _:
            holder[name] = [value] if dice.random() < 0.5 else _copy(dice.choice(_VALUES))


def _copy(value: Any) -> Any:  # noqa: ANN401
    return json.loads(json.dumps(value))
