"""Checks of ids: nothing in a list has the id of another.

Decides: the wording of that fault.  Must not know: what a valid id is (protocol/keys.py).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator


def doubled_ids(field: str, ids: Iterable[str]) -> Iterator[str]:
    """Yield a message for each id in a list that stands earlier in it; empty ids are left out."""
    first: dict[str, int] = {}
    for index, name in enumerate(ids):
        if name and first.setdefault(name, index) != index:
            yield f"{field}[{index}].id: {name!r} is already the id of {field}[{first[name]}]"
