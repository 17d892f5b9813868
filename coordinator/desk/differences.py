"""What has changed between two values of JSON, as a small value of JSON.

A page shows a scene of hundreds of kilobytes, of which little changes at a time.  It makes the new
value of the old one (view/page_files/word.js, `changed`).

Decides: how a difference is written; true and 1 are taken to be the same.  Must not know: what the
values are.

A difference is null (nothing changed), ["=", value] (another value), ["{", {key: difference},
[keys that go]] for objects, or ["[", dropped, {index: difference}, tail] for lists: so many items
go from the front, then items change, then the tail follows.
"""

from __future__ import annotations

from typing import Any, Final

Json = Any
Difference = list[Any] | None

_SHIFTS: Final = 256
"""The front of a list is looked for so far."""


def difference(old: Json, new: Json) -> Difference:
    """Return what makes `new` of `old`."""
    if old is new or old == new:
        return None
    if isinstance(old, dict) and isinstance(new, dict):
        return _of_objects(old, new)
    if isinstance(old, list) and isinstance(new, list):
        return _of_lists(old, new)
    return ["=", new]


def _of_objects(old: dict[str, Json], new: dict[str, Json]) -> Difference:
    changes = {
        key: ["=", value] if key not in old else difference(old[key], value)
        for key, value in new.items()
    }
    told = {key: one for key, one in changes.items() if one is not None}
    return ["{", told, [key for key in old if key not in new]]


def _of_lists(old: list[Json], new: list[Json]) -> Difference:
    if not old or not new or _is_flat(new):
        return ["=", new]
    dropped = next((shift for shift in range(min(len(old), _SHIFTS)) if old[shift] == new[0]), 0)
    kept = old[dropped:]
    if len(kept) > len(new):
        return ["=", new]
    pairs = enumerate(zip(kept, new, strict=False))
    changes = {str(i): one for i, (a, b) in pairs if (one := difference(a, b)) is not None}
    return ["[", dropped, changes, new[len(kept) :]]


def _is_flat(items: list[Json]) -> bool:
    """Return whether a list is short and of plain values: then it is told anew."""
    return len(items) <= 6 and not any(isinstance(one, dict | list) for one in items)
