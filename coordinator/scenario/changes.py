"""The differences between two scenarios, as far as a plan depends on them.

Decides: which fields count and how a difference is described.  Must not know: files, logs.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Final, NamedTuple, TypeAlias

import msgspec

from coordinator.scenario.model import Point, Scenario

_Value: TypeAlias = Mapping[str, "_Value"] | Sequence["_Value"] | str | float | None

_NO_PART: Final = ("notes", "from_map")
"""The fields of a workspace that state where its polygons come from; a plan ignores them."""

_BY_ID: Final = ("robots", "orders")
"""The lists of a scenario whose items are told apart by their ids."""

_MOST_POLYGONS: Final = 5
"""At most this many added or removed obstacles are listed one by one."""

_MOST_LETTERS: Final = 60


class Change(NamedTuple):
    """One field whose values differ; None means that the value is absent."""

    field: str
    before: str | None
    after: str | None


def changes(before: Scenario, after: Scenario) -> list[Change]:
    """Return the changes from one scenario to the other, field by field.

    The order of robots, of orders and of obstacles is ignored.
    """
    old, new = _plain(before), _plain(after)
    return [
        *_compare("", old, new),
        *_polygons(before.workspace.obstacles, after.workspace.obstacles),
    ]


def _plain(scenario: Scenario) -> dict[str, _Value]:
    """Return a scenario as mappings, robots and orders by their ids, without its obstacles."""
    plain = msgspec.to_builtins(scenario)
    for table in _BY_ID:
        plain[table] = {one["id"]: one for one in plain[table]}
    for name in (*_NO_PART, "obstacles"):
        del plain["workspace"][name]
    return dict(plain)


def _compare(field: str, before: _Value, after: _Value) -> Iterator[Change]:
    if isinstance(before, Mapping) and isinstance(after, Mapping):
        for name in {**before, **after}:
            inner = f"{field}[{name}]" if field in _BY_ID else f"{field}.{name}".lstrip(".")
            yield from _compare(inner, before.get(name), after.get(name))
    elif before != after:
        yield Change(field, _short(before), _short(after))


def _polygons(
    before: Sequence[tuple[Point, ...]], after: Sequence[tuple[Point, ...]]
) -> Iterator[Change]:
    old, new = Counter(before), Counter(after)
    gone, come = list((old - new).elements()), list((new - old).elements())
    field = "workspace.obstacles"
    for polygon in islice(gone, _MOST_POLYGONS):
        yield Change(field, _short(polygon), None)
    for polygon in islice(come, _MOST_POLYGONS):
        yield Change(field, None, _short(polygon))
    if max(len(gone), len(come)) > _MOST_POLYGONS:
        yield Change(field, f"{len(before)} in all", f"{len(after)} in all")


def _short(value: object) -> str | None:
    """Return a value as JSON, shortened if it is long; None for an absent value."""
    if value is None:
        return None
    text = str(value) if isinstance(value, float) else msgspec.json.encode(value).decode()
    return text if len(text) <= _MOST_LETTERS else f"{text[: _MOST_LETTERS - 4]} ..."
