"""Copies of a fleet's cores, and digests of them: only what changes is copied.

Frozen structs and frozen dataclasses, tuples, paths and motions are shared by all copies.  A curve
and a timeline remember where they were evaluated last; the follower of a copy evaluates anew, and
what was copied is not to go on itself.
Everything else is copied, also what the cores may have in future.
"""

from __future__ import annotations

import array
import functools
import marshal
import types
from collections import deque
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from hashlib import blake2b
from math import inf
from typing import Any, Final

import msgspec
import numpy as np

from coordinator.curves.nurbs import Nurbs
from coordinator.mission.replanning_input import Site as Replanned
from coordinator.planning.wish import Site
from protocol.curve import Curve
from protocol.timeline import Timeline
from robot_agent.core.steering import PathFollower

_SHARED: Final = {
    int, float, str, bytes, bool, type(None), complex, frozenset, range, array.array,
    types.FunctionType, types.BuiltinFunctionType, Curve, Timeline, Nurbs, Site, Replanned,
}  # fmt: skip


_PLAIN: Final = {int, float, str, bytes, bool, type(None)}


def fork(value: Any, copies: dict[int, Any]) -> Any:
    """Return a copy that shares what never changes; `copies`: those made so far, by identity."""
    cls = type(value)
    kind = _KINDS.get(cls) or _kind(cls)
    return value if kind is _same else kind(value, copies)


def _same(value: Any, _copies: dict[int, Any]) -> Any:
    return value


def _noted(value: Any, copies: dict[int, Any], made: Any) -> Any:
    copies[id(value)] = made
    return made


def _list(value: list[Any], copies: dict[int, Any]) -> list[Any]:
    made = copies.get(id(value))
    if made is None:
        made = copies[id(value)] = value.copy()
        for place, one in enumerate(value):
            if type(one) not in _PLAIN:
                made[place] = fork(one, copies)
    return made


def _dict(value: dict[Any, Any], copies: dict[int, Any]) -> dict[Any, Any]:
    made = copies.get(id(value))
    if made is None:
        made = copies[id(value)] = value.copy()
        for key, one in value.items():
            if type(one) not in _PLAIN:
                made[key] = fork(one, copies)
    return made


def _collection(value: Any, copies: dict[int, Any]) -> Any:
    made = copies.get(id(value))
    return _noted(value, copies, type(value)(value)) if made is None else made


def _tuple(value: tuple[Any, ...], copies: dict[int, Any]) -> tuple[Any, ...]:
    for one in value:
        if type(one) not in _PLAIN:
            break
    else:
        return value
    made = [fork(one, copies) for one in value]
    if all(a is b for a, b in zip(made, value, strict=True)):
        return value
    return type(value)(*made) if hasattr(value, "_fields") else tuple(made)


def _array(value: Any, copies: dict[int, Any]) -> Any:
    made = copies.get(id(value))
    return _noted(value, copies, value.copy()) if made is None else made


def _method(value: types.MethodType, copies: dict[int, Any]) -> types.MethodType:
    return types.MethodType(value.__func__, fork(value.__self__, copies))


def _partial(value: Any, copies: dict[int, Any]) -> Any:
    arguments = (fork(one, copies) for one in value.args)
    return functools.partial(fork(value.func, copies), *arguments, **_dict(value.keywords, copies))


def _object(value: Any, copies: dict[int, Any]) -> Any:
    made = copies.get(id(value))
    if made is None:
        made = _noted(value, copies, object.__new__(type(value)))
        known = made.__dict__
        known.update(value.__dict__)
        for name, one in value.__dict__.items():
            cls = type(one)
            if cls not in _PLAIN:
                kind = _KINDS.get(cls) or _kind(cls)
                if kind is not _same:
                    known[name] = kind(one, copies)
    return made


def _dict_object(value: Any, copies: dict[int, Any]) -> Any:
    made = copies.get(id(value))
    if made is None:
        made = _noted(value, copies, dict.__new__(type(value)))
        for key, one in value.items():
            dict.__setitem__(made, key, fork(one, copies))
        made.__dict__.update(_dict(value.__dict__, copies))
    return made


def _follower(value: PathFollower, copies: dict[int, Any]) -> Any:
    made = copies.get(id(value))
    if made is None:
        made = _object(value, copies)
        made._tangent_s = inf  # Another copy may have evaluated the curve elsewhere since.
    return made


_KINDS: Final[dict[type, Callable[[Any, dict[int, Any]], Any]]] = {
    **dict.fromkeys(_SHARED, _same),
    list: _list,
    dict: _dict,
    set: _collection,
    deque: _collection,
    tuple: _tuple,
    np.ndarray: _array,
    types.MethodType: _method,
    functools.partial: _partial,
    PathFollower: _follower,
}


def _kind(cls: type) -> Callable[[Any, dict[int, Any]], Any]:
    """Find out how values of a class are copied."""
    if (issubclass(cls, msgspec.Struct) and cls.__struct_config__.frozen) or (
        is_dataclass(cls) and cls.__dataclass_params__.frozen  # type: ignore[attr-defined]
    ):
        kind = _same
    elif issubclass(cls, tuple):
        kind = _tuple
    elif issubclass(cls, dict):
        kind = _dict_object
    elif cls.__module__.split(".")[0] in ("coordinator", "robot_agent", "protocol", "tests"):
        kind = _object
    else:
        raise TypeError(f"it is not known how a {cls} is copied")
    _KINDS[cls] = kind
    return kind


class Digests:
    """Digests of states; `left_out`: names of attributes that no later step depends on.

    Shared values count as the same if all their parts do; they are kept alive here.  Time is part
    of a state: plan time runs, so states of different times hardly ever are the same.
    """

    def __init__(self, left_out: frozenset[str]) -> None:
        self._left_out = left_out
        self._shared: dict[int, tuple[int, Any]] = {}
        self._numbers: dict[Any, int] = {}

    def of(self, state: Any) -> bytes:
        """Return the digest of a state."""
        found: list[Any] = []
        self._add(state, found, {})
        return blake2b(marshal.dumps(found, 2), digest_size=16).digest()

    def _add(self, value: Any, found: list[Any], seen: dict[int, int]) -> None:
        """Add what a value is: plain values as they are, others with their kind and parts."""
        cls = type(value)
        if cls in _PLAIN:
            found.append(value)
            return
        if (_KINDS.get(cls) or _kind(cls)) is _same:
            found.append(self._number(value))
            return
        found.append(cls.__name__)
        if id(value) in seen:
            found.append(seen[id(value)])
            return
        seen[id(value)] = len(seen)
        if cls is np.ndarray:
            found.append(value.tobytes())
        elif cls is set:
            found.append(sorted(map(repr, value)))
        else:
            self._add_parts(value, found, seen)

    def _add_parts(self, value: Any, found: list[Any], seen: dict[int, int]) -> None:
        parts = _PARTS.get(type(value))
        if parts is None and isinstance(value, dict | tuple):
            parts = _PARTS[dict if isinstance(value, dict) else tuple]
        if parts is not None:
            parted = parts(value)
            found.append(len(parted))
            for one in parted:
                self._add(one, found, seen)
            return
        for name, one in value.__dict__.items():
            if name not in self._left_out:
                if type(one) in _PLAIN:
                    found.append(one)
                else:
                    self._add(one, found, seen)

    def _number(self, value: Any) -> int:
        """Return the number of a shared value."""
        known = self._shared.get(id(value))
        if known is None:
            try:
                number = self._numbers.setdefault(self._known_by(value), len(self._numbers))
            except TypeError:
                number = self._numbers.setdefault(("id", id(value)), len(self._numbers))
            known = self._shared[id(value)] = number, value
        return known[0]

    def _known_by(self, value: Any) -> Any:
        """Return what a shared value is known by: its parts, or itself."""
        cls = type(value)
        if cls is Curve:
            return tuple(bytes(one) for one in (value.knots, value._hx, value._hy, value._hw))
        if cls is Timeline:
            return tuple(bytes(one) for one in (value.t0, value.t1, value.s0, value.s1, value.v0))
        if cls is types.FunctionType:  # What it has closed over stands beside it, as in a Job.
            return cls, value.__qualname__
        if cls is np.ndarray:
            return value.shape, value.dtype.str, value.tobytes()
        if is_dataclass(cls):
            return cls, *(self._number(getattr(value, field.name)) for field in fields(cls))
        if isinstance(value, tuple | list):
            return cls, *map(self._number, value)
        if isinstance(value, dict):
            return cls, *map(self._number, value.items())
        return cls, value


_PARTS: Final[dict[type, Callable[[Any], tuple[Any, ...]]]] = {
    list: tuple,
    tuple: tuple,
    deque: tuple,
    dict: lambda value: (*value.keys(), *value.values()),
    types.MethodType: lambda value: (value.__func__.__qualname__, value.__self__),
    functools.partial: lambda value: (value.func, value.args, value.keywords),
}
