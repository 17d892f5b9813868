"""Results that are kept with the object that they were found for, as long as that lives.

Decides: how long a result is kept.  Must not know: what the results are.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

Result = TypeVar("Result")


def kept(function: Callable[..., Result]) -> Callable[..., Result]:
    """Keep a function's results with its first argument; the other arguments are hashable.

    A result must not refer to that argument, which would live for ever then.
    """
    known: WeakKeyDictionary[object, dict[tuple[object, ...], Result]] = WeakKeyDictionary()

    @wraps(function)
    def found(owner: object, *others: object) -> Result:
        try:
            results = known[owner]
        except KeyError:
            results = known[owner] = {}
        if others not in results:
            results[others] = function(owner, *others)
        return results[others]

    return found
