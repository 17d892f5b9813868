"""What has changed between two values of JSON, as a small value of JSON.

A page shows a scene of hundreds of kilobytes, of which little changes at a time.  It makes the new
value of the old one (view/page_files/word.js, `changed`).

Decides: how a difference is written; true and 1 are taken to be the same.  Must not know: what the
values are.

A difference is null (nothing changed), ["=", value] (another value), ["{", {key: difference},
[keys that go]] for objects, or ["[", [indices that go], {index: difference}, [[index, value]]] for
lists: items go, then some of those that stay change, then others come, at their places in the end.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec

Json = Any
Difference = list[Any] | None

_DEEP: Final = (msgspec.Struct, list, tuple)

_SHIFTS: Final = 256
"""An item that has moved is looked for so far."""


def difference(old: Json, new: Json) -> Difference:
    """Return what makes `new` of `old`."""
    if old is new or old == new:
        return None
    if isinstance(old, dict) and isinstance(new, dict):
        return _of_objects(old, new)
    if isinstance(old, list) and isinstance(new, list):
        return _of_lists(old, new)
    return ["=", new]


def plain(value: Json) -> Json:
    """Return a value of msgspec's structs as JSON has it; lists and tuples of numbers stay.

    So what is the same object in two scenes needs no comparison.
    """
    if isinstance(value, msgspec.Struct):
        return {name: plain(getattr(value, name)) for name in value.__struct_fields__}
    if isinstance(value, list | tuple) and value and isinstance(value[0], _DEEP):
        return [plain(one) for one in value]
    return value


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
    gone: list[int] = []
    changes: dict[str, Difference] = {}
    come: list[list[Json]] = []
    i = j = 0
    while i < len(old) and j < len(new):
        if old[i] is not new[j] and old[i] != new[j]:
            goes, comes = _find(new[j], old, i), _find(old[i], new, j)
            if goes is not None and (comes is None or goes <= comes):
                gone += range(i, i + goes)
                i += goes
            elif comes is not None:
                come += [[k, new[k]] for k in range(j, j + comes)]
                j += comes
            else:
                changes[str(i - len(gone))] = difference(old[i], new[j])
        i, j = i + 1, j + 1
    gone += range(i, len(old))
    come += [[k, new[k]] for k in range(j, len(new))]
    return ["[", gone, changes, come]


def _find(item: Json, items: list[Json], after: int) -> int | None:
    """Return how far after an index an item is in a list; None if it is not near."""
    near = range(after + 1, min(after + _SHIFTS, len(items)))
    return next((k - after for k in near if items[k] is item or items[k] == item), None)


def _is_flat(items: list[Json]) -> bool:
    """Return whether a list is short and of plain values: then it is told anew."""
    return len(items) <= 6 and not any(isinstance(one, dict | list) for one in items)
