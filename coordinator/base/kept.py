"""Results that are kept with the object that they were found for, as long as that lives.

Decides: how long a result is kept.  Must not know: what the results are.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar

Result = TypeVar("Result")


def kept(function: Callable[..., Result]) -> Callable[..., Result]:
    """Keep a function's results in its first argument; the other arguments are hashable.

    The first argument is an object with a `__dict__` that is compared by identity, and does not
    change.
    """
    name = f"{function.__module__}.{function.__qualname__}"

    @wraps(function)
    def found(owner: object, *others: object) -> Result:
        known: dict[str, dict[tuple[object, ...], Result]] = owner.__dict__
        try:
            return known[name][others]
        except KeyError:
            result = function(owner, *others)
            known.setdefault(name, {})[others] = result
            return result

    return found
